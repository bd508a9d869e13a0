//! Cryptomatte layers: shares of pixels, read back by an independent reader.

use std::collections::HashMap;

use exr::prelude::*;
use serde_json::Value;

use crate::cli::fluxion;

/// Two balls behind each other and a leaf half of which is holes, seen by an orthographic camera of one pixel.
const SCENE: &str = r#"<scene version="3.0.0">
<sensor type="orthographic"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="1"/></film></sensor>
<emitter type="constant"/>
<bsdf type="diffuse" id="paint"/>
<shape type="sphere" id="front"><point name="center" x="CENTER"/><float name="radius" value="0.2"/><ref id="paint"/></shape>
<shape type="sphere" id="back"><point name="center" x="CENTER" z="-2"/><float name="radius" value="0.4"/><ref id="paint"/></shape>
<shape type="rectangle" id="leaf"><transform name="to_world"><scale x="0.25" y="0.25"/><translate x="OTHER"/></transform>
<bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="conductor"/></bsdf></shape>
</scene>"#;

/// Names and shares of a pixel, from the channels of ranks.
fn shares(
    channels: &HashMap<String, Vec<f32>>,
    names: &HashMap<u32, String>,
    matte: &str,
    pixel: usize,
) -> Vec<(String, f32)> {
    let pairs = (0..3).flat_map(|layer| [("R", "G"), ("B", "A")].map(|pair| (layer, pair)));
    let value = |layer: i32, channel: &str| channels[&format!("{matte}{layer:02}.{channel}")][pixel];
    pairs
        .map(|(layer, (id, share))| (value(layer, id), value(layer, share)))
        .filter(|(_, share)| *share > 0.0)
        .map(|(id, share)| (names[&id.to_bits()].clone(), share))
        .collect()
}

#[test]
fn shares_are_those_of_the_shapes_and_read_by_others() {
    let folder = tempfile::tempdir().unwrap();
    // Pixels are squares of length one: the film is two units wide, and half as high.
    std::fs::write(folder.path().join("a.xml"), SCENE.replace("CENTER", "-0.5").replace("OTHER", "0.5")).unwrap();
    let options = ["--spp", "64", "--method", "primal", "-q", "--cryptomatte", "m.exr"];
    fluxion(folder.path()).args(["render", "a.xml", "-o", "a.exr"]).args(options).assert().success();
    let image = read_first_flat_layer_from_file(folder.path().join("m.exr")).unwrap();
    let layer = image.layer_data;
    let channels: HashMap<_, Vec<_>> = layer
        .channel_data
        .list
        .iter()
        .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()))
        .collect();
    let attributes: HashMap<String, String> = layer
        .attributes
        .other
        .iter()
        .filter_map(|(name, value)| Some((name.to_string(), value.to_text().ok()?.to_string())))
        .collect();
    for matte in ["CryptoObject", "CryptoMaterial"] {
        let is_name = |(name, value): &(&String, &String)| name.ends_with("/name") && *value == matte;
        let key = attributes.iter().find(is_name).unwrap().0.strip_suffix("name").unwrap();
        let text = |what: &str| attributes[&format!("{key}{what}")].as_str();
        assert_eq!((text("hash"), text("conversion")), ("MurmurHash3_32", "uint32_to_float32"));
        let manifest: HashMap<String, Value> = serde_json::from_str(text("manifest")).unwrap();
        let names: HashMap<_, _> = manifest
            .iter()
            .map(|(name, id)| (u32::from_str_radix(id.as_str().unwrap(), 16).unwrap(), name.clone()))
            .collect();
        let pi = std::f32::consts::PI;
        let (front, back) = (pi * 0.04, pi * (0.16 - 0.04));
        let expected: [Vec<(&str, f32)>; 2] = if matte == "CryptoObject" {
            [vec![("back", back), ("front", front)], vec![("leaf", 0.125)]]
        } else {
            [vec![("paint", back + front)], vec![("mask_line_9", 0.125)]]
        };
        for (pixel, expected) in expected.iter().enumerate() {
            let found = shares(&channels, &names, matte, pixel);
            assert_eq!(found.len(), expected.len(), "{found:?}");
            for ((name, share), (expected_name, expected)) in found.iter().zip(expected) {
                assert!(name == expected_name && (share - expected).abs() < 0.05, "{found:?}");
            }
        }
    }
    // Plain numbers: of the names in their order.
    let names: Vec<String> = serde_json::from_str(&attributes["fluxion:object.id"]).unwrap();
    let of_pixel = |pixel: usize| names[channels["object.id"][pixel] as usize - 1].as_str();
    assert_eq!((of_pixel(0), of_pixel(1)), ("back", "leaf"));
}

#[test]
fn instances_of_a_group_are_told_apart() {
    let scene = crate::common::scene(
        r#"<sensor type="orthographic"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="1"/></film></sensor>
        <shape type="shapegroup" id="group"><shape type="sphere" id="ball"><float name="radius" value="0.3"/></shape></shape>
        <shape type="instance" id="left"><ref id="group"/><transform name="to_world"><translate x="-0.5"/></transform></shape>
        <shape type="instance" id="right"><ref id="group"/><transform name="to_world"><translate x="0.5"/></transform></shape>
        <shape type="rectangle" id="wall"><transform name="to_world"><scale value="4"/><translate z="-1"/></transform></shape>"#,
    );
    let mattes = fluxion::output::mattes::mattes(&scene, 0, 16);
    let names = |kind: usize, pixel: usize| {
        let mut names: Vec<_> = mattes[kind].pixels[pixel].iter().map(|(name, _)| name.to_string()).collect();
        names.sort();
        names
    };
    assert_eq!((mattes.len(), mattes[2].name), (3, "CryptoInstance"));
    // The film's x runs to the left of the camera's.
    let sides = [names(2, 0), names(2, 1)];
    assert!(sides.contains(&vec!["left".to_owned(), "wall".into()]), "{sides:?}");
    assert!(sides.contains(&vec!["right".to_owned(), "wall".into()]), "{sides:?}");
    assert_eq!((names(0, 0), names(0, 1)), (vec!["ball".into(), "wall".into()], vec!["ball".into(), "wall".into()]));
}
