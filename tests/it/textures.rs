//! Image files of every format, depth and set of channels: the colours that they stand for, as textures and around scenes.
//! Unless a row says otherwise, they are those of Mitsuba 3.9.1.

use std::fs;

use crate::common::film;
use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, SmallVec, WritableImage, f16};
use fluxion::film::{Layer, Needs};
use fluxion::mitsuba;
use fluxion::scene::Scene;

/// Columns and rows of all images.
const SIZE: (usize, usize) = (4, 2);

fn repeated<T: Clone>(pixel: &[T]) -> Vec<T> {
    pixel.iter().cloned().cycle().take(pixel.len() * SIZE.0 * SIZE.1).collect()
}

/// A png of one colour; `tag` may be an ancillary chunk that says what its numbers mean.
fn png(depth: png::BitDepth, pixel: &[u16], tag: &str) -> Vec<u8> {
    use png::{BitDepth, ColorType};
    let color = [ColorType::Grayscale, ColorType::GrayscaleAlpha, ColorType::Rgb, ColorType::Rgba][pixel.len() - 1];
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, SIZE.0 as u32, SIZE.1 as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    match tag {
        "gAMA" => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
        "sRGB" => encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual),
        _ => {}
    }
    let byte =
        |sample: &u16| if depth == BitDepth::Eight { vec![*sample as u8] } else { sample.to_be_bytes().to_vec() };
    let data: Vec<u8> = repeated(pixel).iter().flat_map(byte).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

/// An uncompressed tiff of one colour, of samples in so many bytes; floats if `float`.
fn tiff(pixel: &[Vec<u8>], float: bool) -> Vec<u8> {
    let (count, size) = (pixel.len() as u16, pixel[0].len());
    let data: Vec<u8> = repeated(pixel).concat();
    let (width, height) = (SIZE.0 as u32, SIZE.1 as u32);
    let entry = |tag: u16, kind: u16, count: u32, value: u32| {
        [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value.to_le_bytes()].concat()
    };
    let color = if count < 3 { 1 } else { 2 };
    let mut entries = vec![
        entry(256, 3, 1, width),
        entry(257, 3, 1, height),
        entry(258, 3, 1, 8 * size as u32),
        entry(259, 3, 1, 1),
        entry(262, 3, 1, color),
        entry(273, 4, 1, 8),
        entry(277, 3, 1, u32::from(count)),
        entry(278, 3, 1, height),
        entry(279, 4, 1, data.len() as u32),
    ];
    let bits = 8 + data.len() as u32;
    if count > 2 {
        entries[2] = entry(258, 3, u32::from(count), bits);
    }
    if count % 2 == 0 {
        entries.push(entry(338, 3, 1, 2));
    }
    let kind = if float { 3 } else { 1 };
    let formats = bits + 2 * u32::from(count);
    entries.push(if count > 2 { entry(339, 3, u32::from(count), formats) } else { entry(339, 3, 1, kind) });
    let depths: Vec<u8> = (0..count).flat_map(|_| (8 * size as u16).to_le_bytes()).collect();
    let kinds: Vec<u8> = (0..count).flat_map(|_| (kind as u16).to_le_bytes()).collect();
    let directory = formats + 2 * u32::from(count);
    let head = [b"II*\0".as_slice(), &directory.to_le_bytes()].concat();
    let entries = [(entries.len() as u16).to_le_bytes().to_vec(), entries.concat(), vec![0; 4]].concat();
    [head, data, depths, kinds, entries].concat()
}

fn bytes_of(values: &[u16], size: usize) -> Vec<Vec<u8>> {
    values.iter().map(|value| if size == 1 { vec![*value as u8] } else { value.to_le_bytes().to_vec() }).collect()
}

/// Kinds of samples in an exr file.
#[derive(Clone, Copy)]
enum Kind {
    Half,
    Float,
    Uint,
}

fn exr(channels: &[(&str, Kind, f32)]) -> Vec<u8> {
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> = channels
        .iter()
        .map(|(name, kind, value)| {
            let count = SIZE.0 * SIZE.1;
            let samples = match kind {
                Kind::Half => FlatSamples::F16(vec![f16::from_f32(*value); count]),
                Kind::Float => FlatSamples::F32(vec![*value; count]),
                Kind::Uint => FlatSamples::U32(vec![*value as u32; count]),
            };
            AnyChannel::new(*name, samples)
        })
        .collect();
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_channels(SIZE, AnyChannels::sort(list)).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn netpbm(head: &str, pixel: &[u8]) -> Vec<u8> {
    [format!("{head}\n").as_bytes(), &repeated(pixel)].concat()
}

/// A view of an image on a square that shines, or around an empty scene.
fn view(name: &str, bytes: &[u8], raw: bool, around: bool, extra: &str) -> fluxion::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), bytes).unwrap();
    let file = format!("<string name=\"filename\" value=\"{name}\"/>{extra}");
    let body = if around {
        format!("<emitter type=\"envmap\">{file}</emitter>")
    } else {
        format!(
            "<shape type=\"rectangle\"><emitter type=\"area\"><texture type=\"bitmap\" name=\"radiance\">{file}<boolean \
            name=\"raw\" value=\"{raw}\"/></texture></emitter></shape>"
        )
    };
    let text = format!(
        "<scene version=\"3.0.0\"><sensor type=\"orthographic\"><transform name=\"to_world\"><lookat origin=\"0,0,5\" \
        target=\"0,0,0\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"4\"/><integer \
        name=\"height\" value=\"4\"/></film></sensor>{body}</scene>"
    );
    fs::write(folder.path().join("scene.xml"), text).unwrap();
    mitsuba::load(&folder.path().join("scene.xml"), &mitsuba::Options::default())
}

/// The one colour of a view.
fn color(scene: &Scene) -> [f32; 3] {
    let frame = film(scene, 4, 1, Needs::default()).develop();
    let direct = frame.get(Layer::Direct).unwrap();
    let first = direct.rgb(0, 0);
    assert!(
        (0..16).all(|i| direct.rgb(i % 4, i / 4).distance(first) <= 1e-3 * first.length()),
        "the image is not even"
    );
    first.to_array()
}

/// sRGB to linear, of a share of the largest number.
fn srgb(encoded: f32) -> f32 {
    fluxion::internals::math::srgb_decode(encoded)
}

/// A file and its colour: decoded, and with `raw`.
struct Row {
    name: String,
    bytes: Vec<u8>,
    decoded: [f32; 3],
    raw: [f32; 3],
}

fn integer_rows() -> Vec<Row> {
    let mut rows = Vec::new();
    for (depth, most, grey, rgb) in [(8, 255.0, 128u16, [64u16, 128, 192]), (16, 65535.0, 32769, [4660, 32769, 49374])]
    {
        let share = |value: u16| f32::from(value) / most;
        let colors = [[grey; 3], rgb].map(|rgb| rgb.map(share));
        for (pixel, color) in [
            (vec![grey], colors[0]),
            (vec![grey, 64], colors[0]),
            (vec![grey, 0], colors[0]),
            (rgb.to_vec(), colors[1]),
            ([&rgb[..], &[64]].concat(), colors[1]),
            ([&rgb[..], &[0]].concat(), colors[1]),
        ] {
            let mut add = |name: String, bytes| rows.push(Row { name, bytes, decoded: color.map(srgb), raw: color });
            let bits = if depth == 8 { png::BitDepth::Eight } else { png::BitDepth::Sixteen };
            for tag in ["", "gAMA", "sRGB"] {
                add(format!("{depth} bits, {pixel:?} {tag}.png"), png(bits, &pixel, tag));
            }
            // Mitsuba reads no tiff files.
            add(format!("{depth} bits, {pixel:?}.tiff"), tiff(&bytes_of(&pixel, depth / 8), false));
        }
        let bytes: Vec<u8> = if depth == 8 {
            rgb.iter().map(|&value| value as u8).collect()
        } else {
            // By the format's definition; Mitsuba takes the bytes the other way round.
            rgb.iter().flat_map(|value| value.to_be_bytes()).collect()
        };
        let head = format!("P6\n{} {}\n{}", SIZE.0, SIZE.1, most);
        rows.push(Row {
            name: format!("{depth} bits.ppm"),
            bytes: netpbm(&head, &bytes),
            decoded: colors[1].map(srgb),
            raw: colors[1],
        });
    }
    rows
}

fn float_rows() -> Vec<Row> {
    let rgb = [0.3f32, 0.7, 2.5];
    let mut rows = Vec::new();
    let mut add = |name: &str, bytes, color: [f32; 3]| {
        rows.push(Row { name: name.into(), bytes, decoded: color, raw: color });
    };
    let floats: Vec<Vec<u8>> = rgb.iter().map(|value| value.to_le_bytes().to_vec()).collect();
    add("floats.tiff", tiff(&floats, true), rgb);
    let flat: Vec<u8> = floats.concat();
    add("floats.pfm", netpbm(&format!("PF\n{} {}\n-1.0", SIZE.0, SIZE.1), &flat), rgb);
    for (what, kind) in [("half", Kind::Half), ("float", Kind::Float)] {
        let three = |names: [&'static str; 3]| [0, 1, 2].map(|c: usize| (names[c], kind, rgb[c]));
        let name = |of: &str| format!("{what} {of}.exr");
        add(&name("rgb"), exr(&three(["R", "G", "B"])), rgb);
        add(&name("rgba"), exr(&[&three(["R", "G", "B"])[..], &[("A", kind, 0.25)]].concat()), rgb);
        add(&name("y"), exr(&[("Y", kind, 0.3)]), [0.3; 3]);
        add(&name("ya"), exr(&[("Y", kind, 0.3), ("A", kind, 0.0)]), [0.3; 3]);
        add(&name("xyz"), exr(&three(["X", "Y", "Z"])), [-1.3502, 1.12631, 2.51714]);
        add(&name("dots"), exr(&three([".R", ".G", ".B"])), rgb);
        add(&name("layer"), exr(&three(["beauty.R", "beauty.G", "beauty.B"])), rgb);
        add(&name("lower case"), exr(&three(["r", "g", "b"])), rgb);
        add(&name("and depth"), exr(&[&three(["R", "G", "B"])[..], &[("Z", Kind::Float, 9.0)]].concat()), rgb);
    }
    let numbers = [("R", Kind::Uint, 3.0), ("G", Kind::Uint, 5.0), ("B", Kind::Uint, 7.0)];
    add("numbers.exr", exr(&numbers), [3.0, 5.0, 7.0]);
    add("one number.exr", exr(&[("Y", Kind::Uint, 3.0)]), [3.0; 3]);
    // Mitsuba reads all channels as the first one is stored, and loses the fractions.
    let with_ids = [("R", Kind::Half, 0.5), ("G", Kind::Half, 0.25), ("B", Kind::Half, 2.0), ("ID", Kind::Uint, 7.0)];
    add("colours and numbers.exr", exr(&with_ids), [0.5, 0.25, 2.0]);
    rows
}

fn near(found: [f32; 3], expected: [f32; 3], what: &str) {
    let apart = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 2e-3 * b.abs() + 1e-5);
    assert!(apart, "{what}: {found:?} instead of {expected:?}");
}

#[test]
fn every_format_depth_and_set_of_channels_has_its_colours() {
    for Row { name, bytes, decoded, raw } in integer_rows().into_iter().chain(float_rows()) {
        let file = format!("image.{}", name.rsplit('.').next().unwrap());
        for (is_raw, expected) in [(false, decoded), (true, raw)] {
            let scene = view(&file, &bytes, is_raw, false, "").unwrap_or_else(|error| panic!("{name}: {error}"));
            // Light below zero is none.
            near(color(&scene), expected, &format!("{name}, raw {is_raw}"));
        }
        let scene = view(&file, &bytes, false, true, "").unwrap_or_else(|error| panic!("{name}: {error}"));
        near(color(&scene), decoded, &format!("{name} around the scene"));
    }
}

#[test]
fn eight_bits_of_the_display_formats_are_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let image = fluxion::Image::from_rgb(SIZE.0, SIZE.1, |_, _| fluxion::internals::math::vec3(0.25, 0.5, 0.75));
    for name in ["a.jpg", "a.png", "a.hdr", "a.exr"] {
        let path = folder.path().join(name);
        fluxion::write_color(&path, &image, &fluxion::Extras::default()).unwrap();
        let found = color(&view(name, &fs::read(&path).unwrap(), false, false, "").unwrap());
        assert!(
            found.iter().zip([0.25, 0.5, 0.75]).all(|(a, b): (&f32, f32)| (a - b).abs() < 0.02),
            "{name}: {found:?}"
        );
    }
}

#[test]
fn channels_that_are_no_colour_are_refused_or_chosen_by_name() {
    let half = |name, value| (name, Kind::Half, value);
    for channels in [
        vec![half("R", 1.0), half("G", 1.0)],
        vec![half("U", 1.0), half("V", 1.0)],
        vec![half("Y", 1.0), half("RY", 0.0), half("BY", 0.0)],
        vec![
            half("a.R", 1.0),
            half("a.G", 1.0),
            half("a.B", 1.0),
            half("b.R", 1.0),
            half("b.G", 1.0),
            half("b.B", 1.0),
        ],
    ] {
        let message = view("a.exr", &exr(&channels), false, false, "").err().expect("two are no grey").to_string();
        assert!(message.contains("a.exr") && message.contains("R, G and B, or Y"), "{message}");
    }
    let image = png(png::BitDepth::Eight, &[64, 128, 192, 32], "");
    for (channel, expected) in [("r", srgb(64.0 / 255.0)), ("b", srgb(192.0 / 255.0)), ("a", 32.0 / 255.0)] {
        let extra = format!("<string name=\"channel\" value=\"{channel}\"/>");
        near(color(&view("a.png", &image, false, false, &extra).unwrap()), [expected; 3], channel);
    }
    let missing = view("a.png", &image, false, false, "<string name=\"channel\" value=\"x\"/>");
    assert!(missing.err().unwrap().to_string().contains("no channel `x` among R, G, B, A"));
}

#[test]
fn a_gamma_of_the_file_is_decoded_everywhere() {
    let gamma = |value: f32| format!("<float name=\"gamma\" value=\"{value}\"/>");
    for depth in [png::BitDepth::Eight, png::BitDepth::Sixteen] {
        let (image, share) = match depth {
            png::BitDepth::Eight => (png(depth, &[128], ""), 128.0 / 255.0),
            _ => (png(depth, &[32769], ""), 0.5f32),
        };
        for (value, expected) in [(1.0, share), (1.8, share.powf(1.8)), (3.0, share.powf(3.0))] {
            for around in [false, true] {
                let scene = view("a.png", &image, false, around, &gamma(value)).unwrap();
                near(color(&scene), [expected; 3], &format!("gamma {value}, around {around}"));
            }
        }
    }
    assert!(view("a.png", &png(png::BitDepth::Eight, &[9], ""), false, false, &gamma(-2.0)).is_err());
}

#[test]
fn texels_that_are_not_finite_are_counted_and_a_clipped_sun_is_bright() {
    for (value, expected) in [(f32::INFINITY, 65504.0), (f32::NAN, 0.0), (f32::NEG_INFINITY, 0.0)] {
        for kind in [Kind::Half, Kind::Float] {
            let bytes = exr(&[("R", kind, value), ("G", kind, 1.0), ("B", kind, 1.0)]);
            let scene = view("sun.exr", &bytes, false, true, "").unwrap();
            near(color(&scene), [expected, 1.0, 1.0], "the sun");
            let warning = &scene.warnings()[0];
            assert!(warning.contains("sun.exr: 8 texels are not finite"), "{warning}");
        }
    }
}

#[test]
fn environments_may_be_as_small_as_one_texel() {
    let one = exr_of((1, 1), &[2.0]);
    near(color(&view("one.exr", &one, false, true, "").unwrap()), [2.0; 3], "one texel");
    let bright = exr_of((1, 2), &[2.0, 4.0]);
    let scene = view("two.exr", &bright, false, true, "").unwrap();
    // Straight ahead it is half way from the one above to the one below.
    near(color(&scene), [3.0; 3], "two texels");
}

fn exr_of((width, height): (usize, usize), values: &[f32]) -> Vec<u8> {
    let channel = AnyChannel::new("Y", FlatSamples::F32(values.to_vec()));
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> = [channel].into_iter().collect();
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_channels((width, height), AnyChannels::sort(list)).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}
