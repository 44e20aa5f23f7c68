//! Compares the V4L2 bindings with the kernel's own header, by a C program that is compiled here,
//! and with published numbers. Also checks which tools a build requires.
#![cfg(all(target_os = "linux", feature = "v4l2"))]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::mem::{offset_of, size_of};
use std::process::Command;
use v4l::v4l_sys as sys;
use v4l::v4l2::vidioc;

/// Numbers in the bindings, keyed by the C expression that gives the kernel's value.
#[derive(Default)]
struct Bindings(BTreeMap<String, u64>);

/// `fields!(bindings, struct: field, field = its name in C, ...)` adds the size of a struct and the
/// offsets of its fields.
macro_rules! fields {
    ($bindings:ident, $name:ident: $($field:ident $(= $c:literal)?),*) => {
        $bindings.put(format!("sizeof(struct {})", stringify!($name)), size_of::<sys::$name>());
        $({
            let c = [$($c,)? stringify!($field)][0];
            $bindings.put(
                format!("offsetof(struct {}, {c})", stringify!($name)),
                offset_of!(sys::$name, $field),
            );
        })*
    };
}

/// `requests!(bindings, NAME, ...)` adds the codes of ioctls.
macro_rules! requests {
    ($bindings:ident, $($name:ident),*) => {
        $($bindings.put(stringify!($name).to_owned(), vidioc::$name as usize);)*
    };
}

/// `constants!(bindings, NAME or NAME = its name in C, ...)` adds constants.
macro_rules! constants {
    ($bindings:ident, $($name:ident $(= $c:literal)?),*) => {
        $($bindings.put([$($c,)? stringify!($name)][0].to_owned(), sys::$name as usize);)*
    };
}

impl Bindings {
    fn put(&mut self, expression: String, value: usize) {
        assert_eq!(self.0.insert(expression, value as u64), None);
    }

    fn all() -> Self {
        let mut b = Self::default();
        fields!(b, timeval: tv_sec, tv_usec);
        fields!(b, v4l2_fract: numerator, denominator);
        fields!(b, v4l2_capability: driver, card, bus_info, version, capabilities, device_caps);
        fields!(b, v4l2_fmtdesc: index, type_ = "type", flags, description, pixelformat);
        fields!(b, v4l2_format: type_ = "type", fmt);
        fields!(b, v4l2_pix_format: width, height, pixelformat, field, bytesperline, sizeimage, colorspace,
            priv_ = "priv", flags, quantization, xfer_func);
        fields!(b, v4l2_requestbuffers: count, type_ = "type", memory, capabilities, flags, reserved);
        fields!(b, v4l2_timecode: type_ = "type", flags, frames, userbits);
        fields!(b, v4l2_buffer: index, type_ = "type", bytesused, flags, field, timestamp, timecode, sequence,
            memory, m, length, reserved2, __bindgen_anon_1 = "request_fd");
        fields!(b, v4l2_streamparm: type_ = "type", parm);
        fields!(b, v4l2_captureparm: capability, capturemode, timeperframe, extendedmode, readbuffers, reserved);
        fields!(b, v4l2_outputparm: capability, outputmode, timeperframe, extendedmode, writebuffers, reserved);
        fields!(b, v4l2_frmsize_discrete: width, height);
        fields!(b, v4l2_frmsize_stepwise: min_width, max_width, step_width, min_height, max_height, step_height);
        fields!(b, v4l2_frmsizeenum: index, pixel_format, type_ = "type", __bindgen_anon_1 = "discrete", reserved);
        fields!(b, v4l2_frmival_stepwise: min, max, step);
        fields!(b, v4l2_frmivalenum: index, pixel_format, width, height, type_ = "type",
            __bindgen_anon_1 = "discrete", reserved);
        fields!(b, v4l2_control: id, value);
        fields!(b, v4l2_ext_control: id, size, __bindgen_anon_1 = "value64");
        fields!(b, v4l2_ext_controls: __bindgen_anon_1 = "which", count, error_idx, request_fd, controls);
        fields!(b, v4l2_queryctrl: id, type_ = "type", name, minimum, maximum, step, default_value, flags);
        fields!(b, v4l2_query_ext_ctrl: id, type_ = "type", name, minimum, maximum, step, default_value, flags,
            elem_size, elems, nr_of_dims, dims);
        fields!(b, v4l2_querymenu: id, index, __bindgen_anon_1 = "name", reserved);
        requests!(
            b,
            VIDIOC_QUERYCAP,
            VIDIOC_ENUM_FMT,
            VIDIOC_G_FMT,
            VIDIOC_S_FMT,
            VIDIOC_TRY_FMT,
            VIDIOC_REQBUFS,
            VIDIOC_QUERYBUF,
            VIDIOC_QBUF,
            VIDIOC_DQBUF,
            VIDIOC_STREAMON,
            VIDIOC_STREAMOFF,
            VIDIOC_G_PARM,
            VIDIOC_S_PARM,
            VIDIOC_G_CTRL,
            VIDIOC_S_CTRL,
            VIDIOC_QUERYCTRL,
            VIDIOC_QUERY_EXT_CTRL,
            VIDIOC_QUERYMENU,
            VIDIOC_G_EXT_CTRLS,
            VIDIOC_S_EXT_CTRLS,
            VIDIOC_ENUM_FRAMESIZES,
            VIDIOC_ENUM_FRAMEINTERVALS
        );
        constants!(
            b,
            V4L2_CAP_VIDEO_CAPTURE,
            V4L2_CAP_VIDEO_OUTPUT,
            V4L2_CAP_STREAMING,
            V4L2_CAP_DEVICE_CAPS,
            V4L2_BUF_FLAG_ERROR,
            v4l2_field_V4L2_FIELD_NONE = "V4L2_FIELD_NONE",
            v4l2_memory_V4L2_MEMORY_MMAP = "V4L2_MEMORY_MMAP",
            v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE = "V4L2_BUF_TYPE_VIDEO_CAPTURE",
            v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT = "V4L2_BUF_TYPE_VIDEO_OUTPUT"
        );
        b
    }
}

/// Evaluates each expression with the C compiler.
fn kernel(expressions: &[&String]) -> Vec<u64> {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("layout.c");
    let program = folder.path().join("layout");
    let mut c = "#include <stddef.h>\n#include <stdio.h>\n#include <linux/videodev2.h>\n\nint main(void)\n{\n".to_owned();
    for expression in expressions {
        // ioctl codes are unsigned 32-bit numbers; as an enum or int they would be sign-extended.
        writeln!(c, "\tprintf(\"%u\\n\", (unsigned)({expression}));").unwrap();
    }
    c += "\treturn 0;\n}\n";
    std::fs::write(&source, c).unwrap();
    let cc = Command::new("cc")
        .arg(&source)
        .arg("-o")
        .arg(&program)
        .output()
        .expect("a C compiler, cc");
    assert!(
        cc.status.success(),
        "linux/videodev2.h is of the package linux-libc-dev (Debian): {}",
        String::from_utf8_lossy(&cc.stderr)
    );
    let output = Command::new(&program).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(|line| line.parse().unwrap()).collect()
}

#[test]
fn the_bindings_are_laid_out_as_the_kernel_has_them() {
    let bindings = Bindings::all();
    let expressions: Vec<_> = bindings.0.keys().collect();
    let kernel = kernel(&expressions);
    assert_eq!(kernel.len(), bindings.0.len());
    for ((expression, ours), kernel) in bindings.0.iter().zip(kernel) {
        assert_eq!(
            *ours, kernel,
            "{expression}: {ours:#x}, the kernel's is {kernel:#x}"
        );
    }
}

/// The bindings have the values that strace and the kernel's documentation give for 64-bit systems.
#[test]
#[cfg(target_pointer_width = "64")]
fn request_codes_match_published_values() {
    let published = [
        (vidioc::VIDIOC_QUERYCAP, 0x8068_5600),
        (vidioc::VIDIOC_ENUM_FMT, 0xc040_5602),
        (vidioc::VIDIOC_G_FMT, 0xc0d0_5604),
        (vidioc::VIDIOC_S_FMT, 0xc0d0_5605),
        (vidioc::VIDIOC_REQBUFS, 0xc014_5608),
        (vidioc::VIDIOC_QUERYBUF, 0xc058_5609),
        (vidioc::VIDIOC_QBUF, 0xc058_560f),
        (vidioc::VIDIOC_DQBUF, 0xc058_5611),
        (vidioc::VIDIOC_STREAMON, 0x4004_5612),
        (vidioc::VIDIOC_STREAMOFF, 0x4004_5613),
        (vidioc::VIDIOC_S_PARM, 0xc0cc_5616),
        (vidioc::VIDIOC_QUERYCTRL, 0xc044_5624),
        (vidioc::VIDIOC_ENUM_FRAMESIZES, 0xc02c_564a),
        (vidioc::VIDIOC_ENUM_FRAMEINTERVALS, 0xc034_564b),
        (vidioc::VIDIOC_QUERY_EXT_CTRL, 0xc0e8_5667),
    ];
    for (ours, published) in published {
        assert_eq!(ours, published, "{ours:#x}, published {published:#x}");
    }
}

/// Rust and a C compiler suffice for a build, without libclang, libudev or pkg-config.
#[test]
fn a_build_needs_no_library_of_the_system() {
    let targets = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"];
    for target in targets {
        let output = Command::new(env!("CARGO"))
            .args(["tree", "--locked", "--offline", "--edges", "normal,build"])
            .args(["--prefix", "none", "--target", target, "--format", "{p}"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        let tree = String::from_utf8(output.stdout).unwrap();
        let mut names: Vec<_> = tree
            .lines()
            .filter_map(|line| line.split(' ').next())
            .collect();
        names.sort_unstable();
        names.dedup();
        assert!(
            names.contains(&"v4l"),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        for name in [
            "bindgen",
            "clang-sys",
            "libudev",
            "libudev-sys",
            "pkg-config",
            "cmake",
        ] {
            assert!(!names.contains(&name), "{target}: {name}");
        }
    }
}
