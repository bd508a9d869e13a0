//! The wrapper's tests.

use super::*;

fn unit_triangle() -> (Arc<PaddedVertices>, Arc<Vec<[u32; 3]>>) {
    let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    (Arc::new(PaddedVertices::new(vertices.into_iter())), Arc::new(vec![[0, 1, 2]]))
}

fn triangle_and_sphere(device: &Device) -> Committed {
    let (vertices, indices) = unit_triangle();
    let mut builder = device.scene();
    builder.add_triangles(&vertices, &indices).unwrap();
    builder.add_spheres(vec![[1.5, 0.5, 0.0, 0.25]]).unwrap();
    builder.commit().unwrap()
}

fn ray(x: f32, y: f32) -> Ray {
    Ray { origin: [x, y, 1.0], t_near: 0.0, direction: [0.0, 0.0, -1.0], t_far: f32::INFINITY }
}

#[test]
fn a_triangle_and_a_sphere_are_hit_where_they_are() {
    let device = Device::new(1).unwrap();
    let (vertices, indices) = unit_triangle();
    let mut builder = device.scene();
    let triangle = builder.add_triangles(&vertices, &indices).unwrap();
    let sphere = builder.add_spheres(vec![[5.0, 0.0, 0.0, 0.5]]).unwrap();
    let scene = builder.commit().unwrap();
    drop((device, vertices, indices));

    let hit = scene.intersect(&ray(0.25, 0.5)).unwrap();
    assert_eq!((hit.geometry, hit.primitive), (triangle, 0));
    assert!((hit.t - 1.0).abs() < 1e-6 && (hit.u - 0.25).abs() < 1e-6 && (hit.v - 0.5).abs() < 1e-6);
    let hit = scene.intersect(&ray(5.0, 0.0)).unwrap();
    assert_eq!(hit.geometry, sphere);
    assert!((hit.t - 0.5).abs() < 1e-5);
    assert!(scene.intersect(&ray(2.0, 2.0)).is_none());
    assert!(scene.occluded(&ray(0.25, 0.5)) && !scene.occluded(&ray(2.0, 2.0)));
}

#[test]
fn packets_meet_what_single_rays_meet_and_inactive_rays_nothing() {
    // More than this processor has is no restriction.
    let isas = ["isa=sse4.2", "isa=avx2", "isa=avx512"];
    for (isa, width) in isas.iter().flat_map(|isa| [4, 8, 16].map(|width| (isa, width))) {
        let device = Device::with_config(isa).unwrap();
        let mut scene = triangle_and_sphere(&device);
        scene.0.packet_width = width;
        // All, most, few and one active; the last four never, so that a part of a packet is empty.
        for every in [1, 2, 5, 11] {
            check_packet(&scene, |i| i < 12 && i % every == every - 1, &format!("{isa}, width {width}, every {every}"));
        }
    }
}

fn check_packet(scene: &Committed, is_active: impl Fn(usize) -> bool, what: &str) {
    let x: [f32; 16] = std::array::from_fn(|i| 0.05 + 0.12 * i as f32);
    let (zero, one) = ([0.0; 16], [1.0; 16]);
    let rays = Rays {
        origin: [x, [0.4; 16], one],
        direction: [zero, zero, one.map(|_| -1.0)],
        t_far: [f32::INFINITY; 16],
        active: std::array::from_fn(|i| if is_active(i) { !0 } else { 0 }),
    };
    for coherent in [false, true] {
        let (hits, blocked) = (scene.intersect_packet(&rays, coherent), scene.occluded_packet(&rays));
        for i in 0..16 {
            let single = scene.intersect(&ray(x[i], 0.4)).filter(|_| is_active(i));
            let found = hits.get(i);
            assert_eq!((single.is_some(), single.is_some()), (found.is_some(), blocked[i] != 0), "{what}, ray {i}");
            let Some((a, b)) = single.zip(found) else { continue };
            assert_eq!((a.geometry, a.primitive, a.instance()), (b.geometry, b.primitive, b.instance()), "{what}");
            assert!((a.t - b.t).abs() < 1e-5 && (a.u - b.u).abs() < 1e-5 && (a.v - b.v).abs() < 1e-5, "{what}");
        }
    }
}

#[test]
fn packets_are_as_wide_as_the_processor_traces_them() {
    let width = |isa| Device::with_config(isa).unwrap().scene().0.packet_width;
    assert_eq!((width("isa=sse4.2"), width("isa=avx2")), (4, 8));
}

#[test]
fn an_index_out_of_range_and_a_bad_configuration_are_errors() {
    let device = Device::new(1).unwrap();
    let (vertices, _) = unit_triangle();
    let error = device.scene().add_triangles(&vertices, &Arc::new(vec![[0, 1, 3]])).unwrap_err();
    assert!(error.to_string().contains("vertex"));
    assert!(Device::with_config("isa=no_such_isa\0").is_err());
}

#[test]
fn an_error_callback_surfaces_as_an_error() {
    let device = Device::new(1).unwrap();
    // SAFETY: the callback gets the live reported error and a static string, as from Embree.
    unsafe { remember(std::ptr::from_ref::<Reported>(&device.0.reported).cast_mut().cast(), 2, c"no room".as_ptr()) };
    assert_eq!(device.0.check().unwrap_err().to_string(), "embree: no room (error code 2)");
    assert!(device.0.check().is_ok());
}
