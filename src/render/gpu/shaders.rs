//! Shader sources, and assembly of the source of a pass from pieces.
//!
//! The first line of a file names its dependencies: `// needs: plan, maps_in`. A pass consists of
//! each dependency once, in dependency order, followed by the file itself.

use phasmid_core::error::{Error, Result};
use std::borrow::Cow;

use phasmid_shaders::PIECES;

#[cfg(test)]
use phasmid_shaders::TESTS;
#[cfg(not(test))]
const TESTS: &[(&str, &str)] = &[];

/// Returns the source of a pass, including the pieces on which it depends.
///
/// # Errors
/// Returns an error if a piece is missing, which is a mistake in a shader's first line.
pub(super) fn assemble(name: &str) -> Result<String> {
    let mut taken = Vec::new();
    let mut source = String::new();
    append(name, &mut taken, &mut source)?;
    Ok(source)
}

fn append(name: &str, taken: &mut Vec<String>, source: &mut String) -> Result<()> {
    if taken.iter().any(|t| t == name) {
        return Ok(());
    }
    taken.push(name.to_owned());
    let text = piece(name)?;
    for need in needs(&text) {
        append(need, taken, source)?;
    }
    source.push_str(&text);
    source.push('\n');
    Ok(())
}

fn needs(text: &str) -> impl Iterator<Item = &str> {
    let first = text.lines().next().unwrap_or_default();
    let list = first.strip_prefix("// needs:").unwrap_or_default();
    list.split(',').map(str::trim).filter(|n| !n.is_empty())
}

fn piece(name: &str) -> Result<Cow<'static, str>> {
    let found = PIECES.iter().chain(TESTS).find(|(n, _)| *n == name);
    let Some((_, text)) = found else {
        return Err(Error::device(format!("no shader {name}")));
    };
    #[cfg(feature = "shaders-from-disk")]
    {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/");
        let path = format!("{path}{name}.wgsl");
        let _ = text;
        return std::fs::read_to_string(&path)
            .map(Cow::Owned)
            .map_err(|e| Error::io(path, e));
    }
    #[cfg(not(feature = "shaders-from-disk"))]
    Ok(Cow::Borrowed(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
    use wgpu::naga::{Module, front::wgsl};

    fn all() -> impl Iterator<Item = &'static str> {
        PIECES.iter().chain(TESTS).map(|(name, _)| *name)
    }

    fn parsed(name: &str) -> Module {
        let source = assemble(name).unwrap();
        match wgsl::parse_str(&source) {
            Ok(module) => module,
            Err(e) => panic!("{name}: {}", e.emit_to_string(&source)),
        }
    }

    /// Every piece, together with its dependencies, is valid WGSL. This needs no driver.
    #[test]
    fn every_shader_is_valid() {
        for name in all() {
            let module = parsed(name);
            let found =
                Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
            if let Err(e) = found {
                panic!("{name}: {}", e.emit_to_string(&assemble(name).unwrap()));
            }
        }
    }

    /// The engine finds buffers by name, so names and binding numbers must map one to one.
    #[test]
    fn every_binding_has_one_number() {
        let mut numbers: BTreeMap<u32, String> = BTreeMap::new();
        let mut names: BTreeMap<String, u32> = BTreeMap::new();
        for name in all() {
            for (_, variable) in parsed(name).global_variables.iter() {
                let (Some(binding), Some(variable)) = (&variable.binding, &variable.name) else {
                    continue;
                };
                assert_eq!(binding.group, 0, "{name}: {variable}");
                let before = numbers.insert(binding.binding, variable.clone());
                assert!(before.is_none_or(|b| b == *variable), "{name}: {variable}");
                let before = names.insert(variable.clone(), binding.binding);
                assert!(
                    before.is_none_or(|b| b == binding.binding),
                    "{name}: {variable}"
                );
            }
        }
    }

    /// Every file in `shaders/` is embedded in the program.
    #[test]
    fn every_shader_file_is_registered() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders");
        for (folder, prefix) in [(root.to_owned(), ""), (format!("{root}/tests"), "tests/")] {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.extension().is_some_and(|e| e == "wgsl") {
                    let name = format!("{prefix}{}", path.file_stem().unwrap().to_str().unwrap());
                    assert!(all().any(|n| n == name), "{name} is not registered");
                }
            }
        }
    }
}
