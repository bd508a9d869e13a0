//! Finds Embree and OpenImageIO, compiles the shims under `ffi/` and binds their headers.
//!
//! `EMBREE_DIR` (with `include/` and `lib/`), or `EMBREE_INCLUDE_DIR` and `EMBREE_LIB_DIR`, override the search.

use std::env;
use std::path::{Path, PathBuf};
use std::process::exit;

const PACKAGES: &str = "sudo apt-get install g++ pkg-config libclang-dev libembree-dev libopenimageio-dev";

fn main() {
    for file in ["ffi/embree.h", "ffi/embree.cpp", "ffi/oiio.h", "ffi/oiio.cpp"] {
        println!("cargo::rerun-if-changed={file}");
    }
    for variable in ["EMBREE_DIR", "EMBREE_INCLUDE_DIR", "EMBREE_LIB_DIR"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    build_embree();
    bind("ffi/embree.h", "embree.rs", None);
    if env::var_os("CARGO_FEATURE_OPENIMAGEIO").is_some() {
        build_openimageio();
        bind("ffi/oiio.h", "oiio.rs", Some("Shim"));
    }
}

fn fail(reason: &str) -> ! {
    println!("cargo::error={reason}");
    println!("cargo::error=on Debian 12 or 13, install what Fluxion is built on with: {PACKAGES}");
    exit(1);
}

fn directory(whole: &str, part: &str, variable: &str) -> Option<PathBuf> {
    env::var_os(variable).map(PathBuf::from).or_else(|| env::var_os(whole).map(|dir| Path::new(&dir).join(part)))
}

fn build_embree() {
    let include = directory("EMBREE_DIR", "include", "EMBREE_INCLUDE_DIR");
    let version = embree_version(include.as_deref());
    let (major, minor) = (version / 10000, version / 100 % 100);
    if (major, minor) < (3, 13) {
        fail(&format!("Embree {major}.{minor} was found; Fluxion needs 3.13 or later"));
    }
    let mut build = cc::Build::new();
    build.cpp(true).std("c++17").file("ffi/embree.cpp");
    build.define("FLUXION_EMBREE_MAJOR", major.to_string().as_str());
    if let Some(include) = &include {
        build.include(include);
    }
    build.compile("fluxion_embree");
    if let Some(lib) = directory("EMBREE_DIR", "lib", "EMBREE_LIB_DIR") {
        println!("cargo::rustc-link-search=native={}", lib.display());
    }
    println!("cargo::rustc-link-lib=dylib=embree{major}");
}

/// RTC_VERSION (major * 10000 + minor * 100 + patch) as the C preprocessor sees it: the one authority on
/// which header is there.
fn embree_version(include: Option<&Path>) -> u32 {
    let probe = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join("embree_probe.c");
    let source = "#if __has_include(<embree4/rtcore_config.h>)\n#include <embree4/rtcore_config.h>\n\
                  #elif __has_include(<embree3/rtcore_config.h>)\n#include <embree3/rtcore_config.h>\n\
                  #else\n#define RTC_VERSION 0\n#endif\nfluxion_embree_version RTC_VERSION\n";
    if let Err(error) = std::fs::write(&probe, source) {
        fail(&format!("cannot write {}: {error}", probe.display()));
    }
    let mut build = cc::Build::new();
    build.file(&probe).cargo_warnings(false);
    if let Some(include) = include {
        build.include(include);
    }
    let expanded = match build.try_expand() {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) => fail(&format!("no working C compiler: {error}")),
    };
    // Line markers may stand between the word and its macro's value.
    let text: String = expanded.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join(" ");
    let version = text.split_once("fluxion_embree_version").and_then(|(_, rest)| rest.split_whitespace().next());
    match version.and_then(|text| text.parse().ok()) {
        Some(version) if version > 0 => version,
        _ => fail("Embree's headers (embree3/rtcore.h or embree4/rtcore.h) were not found"),
    }
}

fn build_openimageio() {
    let library = pkg_config::Config::new().atleast_version("2.4").cargo_metadata(false).probe("OpenImageIO");
    let library = match library {
        Ok(library) => library,
        Err(_) => fail("OpenImageIO 2.4 or later was not found by pkg-config"),
    };
    let mut build = cc::Build::new();
    build.cpp(true).std("c++17").file("ffi/oiio.cpp").includes(&library.include_paths);
    // The library's own headers are not ours to lint.
    build.flag_if_supported("-Wno-deprecated-declarations").warnings(false);
    // A library of its own, which the program holds and loads when the first image is read or written: OpenImageIO comes with hundreds
    // of others, whose loading would take longer than most commands.
    let objects = build.compile_intermediates();
    let shared = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join("fluxion_oiio.so");
    let mut link = build.get_compiler().to_command();
    link.arg("-shared").arg("-o").arg(&shared).args(&objects);
    link.args(library.link_paths.iter().map(|path| format!("-L{}", path.display())));
    link.args(["-lOpenImageIO", "-lOpenImageIO_Util", "-Wl,-z,defs", "-Wl,-s"]);
    match link.status() {
        Ok(status) if status.success() => {}
        other => fail(&format!("the shim of OpenImageIO could not be linked: {other:?}")),
    }
}

/// Binds a header: as functions that are linked, or as those of a library that is loaded, a type of this name.
fn bind(header: &str, output: &str, loaded: Option<&str>) {
    let mut builder = bindgen::Builder::default();
    if let Some(name) = loaded {
        builder = builder.dynamic_library_name(name).dynamic_link_require_all(true);
    }
    let bindings = builder
        .header(header)
        .allowlist_item("(fluxion|Fluxion|FLUXION).*")
        .derive_default(true)
        .default_enum_style(bindgen::EnumVariation::Rust { non_exhaustive: false })
        .layout_tests(true)
        .generate();
    let bindings = match bindings {
        Ok(bindings) => bindings,
        Err(error) => fail(&format!("binding {header} failed: {error}")),
    };
    let path = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join(output);
    if let Err(error) = bindings.write_to_file(&path) {
        fail(&format!("cannot write {}: {error}", path.display()));
    }
}
