//! Tests PLY files written by hand, malformed PLY files, and round trips through the writer.

use super::*;
use glam::DVec3;
use proptest::prelude::*;

const ASCII: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement camera 2\n\
    property list uchar float pose\nelement vertex 4\nproperty float x\nproperty float y\n\
    property list uchar int tags\nproperty double z\nproperty uchar red\nelement nothing 4000000000\n\
    element face 2\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n\
    3 1 2 3\n0\n0 0 0 0 9\n1 0 2 7 8 0.5 9\n1 1 0 0 9\n0 1 0 0 9\n0 4 0 1 2 3\n1 3 0 1 2\n";

fn binary(big: bool, end: &str) -> Vec<u8> {
    let name = if big { "big" } else { "little" };
    let mut out = format!(
        "ply\nformat binary_{name}_endian 1.0\nelement vertex 3\nproperty float x\n\
         property double y\nproperty short z\nproperty ushort intensity\nelement extra 2\n\
         property list int double junk\nelement face 1\n\
         property list uint ushort vertex_index\nend_header\n"
    )
    .replace('\n', end)
    .into_bytes();
    let mut put = |bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    for i in 0..3_i16 {
        // The first byte of the little-endian body is a line feed, which belongs to the number.
        put(&(f32::from_bits(0x4000_000a) * f32::from(i + 1)).to_le_bytes());
        put(&(0.1 * f64::from(i)).to_le_bytes());
        put(&(-5 * i * i).to_le_bytes());
        put(&(65535 / 5 * i as u16).to_le_bytes());
    }
    put(&0_i32.to_le_bytes());
    put(&1_i32.to_le_bytes());
    put(&1e300_f64.to_le_bytes());
    put(&3_u32.to_le_bytes());
    for i in [2_u16, 1, 0] {
        put(&i.to_le_bytes());
    }
    out
}

#[test]
fn reads_ascii_with_unknown_elements_lists_and_polygons() {
    let mesh = parse_mesh(ASCII.as_bytes(), "m.ply").unwrap();
    assert_eq!(mesh.vertices[1], DVec3::new(1.0, 0.0, 0.5));
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
}

#[test]
fn reads_binary_in_both_byte_orders_and_all_line_ends() {
    for (big, end) in [(false, "\n"), (true, "\n"), (false, "\r\n"), (false, "\r")] {
        let Ply::Mesh(mesh) = parse(&binary(big, end), "m.ply").unwrap() else {
            panic!("a face makes a mesh");
        };
        let x = f64::from(f32::from_bits(0x4000_000a));
        assert_eq!(mesh.vertices[1], DVec3::new(2.0 * x, 0.1, -5.0));
        assert_eq!(mesh.triangles, [[2, 1, 0]]);
        let cloud = cloud(content(&binary(big, end), "m").unwrap(), "m").unwrap();
        assert_eq!(cloud.intensity.unwrap(), [0.0, 0.2, 0.4]);
    }
}

#[test]
fn complaints_name_element_and_row() {
    for (from, to, says) in [
        ("ply\n", "plx\n", "m.ply:1: no `ply`"),
        ("ascii", "morse", "m.ply:2: `morse`"),
        (
            "vertex 4",
            "vertex 400",
            "element vertex: 400 rows declared",
        ),
        ("vertex 4", "vertex 18446744073709551615", "rows declared"),
        ("vertex 4", "vertex -4", "m.ply:6: `-4`"),
        (
            "face 2",
            "face 3",
            "element face: row 2: the end of the file",
        ),
        ("0 4 0 1", "0 4 0 9", "triangle 0: vertex 9"),
        ("0 4 0 1", "0 4 -1 1", "element face: row 0: vertex -1"),
        ("0 4 0 1", "0 99 0 1", "row 0: a list of 99 items"),
        ("0 4 0 1", "0 -4 0 1", "row 0: a list of -4 items"),
        ("1 1 0 0 9", "1 up 0 0 9", "element vertex: row 2: `up`"),
        ("1 1 0 0 9", "1 inf 0 0 9", "vertex 2: (1, inf, 0)"),
        ("double z", "double w", "no x, y and z"),
        ("element vertex", "element point", "no vertices"),
        (
            "property uchar red",
            "property byte red",
            "m.ply:11: `byte`",
        ),
        ("end_header", "end", "m.ply:16: `end`"),
    ] {
        let text = ASCII.replace(from, to);
        let error = parse_mesh(text.as_bytes(), "m.ply")
            .unwrap_err()
            .to_string();
        assert!(error.contains(says), "{from} -> {to}: {error}");
    }
    let whole = binary(false, "\n");
    for cut in 0..whole.len() {
        assert!(parse_mesh(&whole[..cut], "m.ply").is_err(), "cut at {cut}");
    }
}

#[test]
fn a_cloud_must_have_a_finite_point() {
    let text = |rows: &str, n: u32| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n\
             property float z\nend_header\n{rows}"
        )
    };
    assert!(parse(text("", 0).as_bytes(), "c.ply").is_err());
    let error = parse(text("nan 0 0\n1 inf 0", 2).as_bytes(), "c.ply").unwrap_err();
    assert!(error.to_string().contains("none of them finite"), "{error}");
    let Ply::Cloud(cloud) = parse(text("nan 0 0\n1 2 3", 2).as_bytes(), "c.ply").unwrap() else {
        panic!("no face, no mesh");
    };
    assert_eq!(cloud.points[1], [1.0, 2.0, 3.0]);
    assert_eq!(cloud.points.len(), 2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_body_never_panics(
        at in 0_usize..400,
        tail in proptest::collection::vec(any::<u8>(), 0..200),
        which in 0..3_u8,
    ) {
        let mut bytes = match which {
            0 => ASCII.as_bytes().to_vec(),
            1 => binary(false, "\n"),
            _ => binary(true, "\r\n"),
        };
        bytes.truncate(at);
        bytes.extend(tail);
        let _ = parse(&bytes, "m.ply");
    }

    #[test]
    fn a_mutated_file_never_panics(
        edits in proptest::collection::vec((0_usize..500, any::<u8>()), 1..8),
        which in 0..3_u8,
    ) {
        let mut bytes = match which {
            0 => ASCII.as_bytes().to_vec(),
            1 => binary(false, "\n"),
            _ => binary(true, "\r"),
        };
        let len = bytes.len();
        for (at, value) in edits {
            bytes[at % len] = value;
        }
        if let Ok(Ply::Mesh(mesh)) = parse(&bytes, "m.ply") {
            prop_assert!(mesh.vertices.len() + mesh.triangles.len() <= bytes.len());
        }
    }

    #[test]
    fn written_clouds_and_meshes_read_back_equal(
        raw in proptest::collection::vec(-1e5_f32..1e5, 9..60),
        with_normals in any::<bool>(),
        with_intensity in any::<bool>(),
        with_sigma in any::<bool>(),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.ply");
        let points: Vec<[f32; 3]> = raw.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        let cloud = Cloud {
            normals: with_normals.then(|| points.iter().map(|_| [0.0, 0.6, -0.8]).collect()),
            intensity: with_intensity.then(|| points.iter().map(|p| p[0] / 1e5).collect()),
            sigma_mm: with_sigma.then(|| points.iter().map(|p| p[1].abs()).collect()),
            points,
        };
        write_cloud(&path, &cloud).unwrap();
        prop_assert_eq!(&read_cloud(&path).unwrap(), &cloud);
        let mesh = Mesh {
            vertices: raw.chunks_exact(3).map(|c| DVec3::new(f64::from(c[0]) / 3.0,
                f64::from(c[1]), f64::from(c[2]))).collect(),
            triangles: vec![[0, 1, 2], [2, 1, 0], [1, 1, 1]],
            ..Mesh::default()
        };
        write_mesh(&path, &mesh).unwrap();
        prop_assert_eq!(read(&path).unwrap(), Ply::Mesh(mesh));
    }
}

#[test]
fn normals_that_miss_points_are_refused() {
    let cloud = Cloud {
        points: vec![[0.0; 3]; 2],
        normals: Some(vec![[0.0; 3]]),
        ..Cloud::default()
    };
    let dir = tempfile::tempdir().unwrap();
    assert!(write_cloud(&dir.path().join("c.ply"), &cloud).is_err());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}
