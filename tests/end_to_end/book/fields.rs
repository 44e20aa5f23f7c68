//! The reference of every field in the files that a user writes. It is generated from the structs
//! that read these files and from their documentation.

use super::root;
use phasmid::profile::faults::Kind;
use std::collections::{HashMap, HashSet};
use std::fmt::Write;
use std::rc::Rc;
use syn::{
    Attribute, Expr, Field, Fields, GenericArgument, ImplItem, Item, Lit, Meta, PathArguments,
    Stmt, Type,
};

/// Folders and files that define the types of the documents.
const SOURCES: [&str; 13] = [
    "src/profile",
    "src/pattern",
    "src/geometry/board/kind.rs",
    "src/geometry/lens.rs",
    "src/geometry/pose.rs",
    "src/geometry/rig/covariance.rs",
    "src/geometry/rig/mod.rs",
    "src/phantom/lib.rs",
    "src/phantom/parameters.rs",
    "src/phantom/tissue.rs",
    "src/phantom/breathing/mod.rs",
    "src/protocol/faults",
    "src/protocol/frame.rs",
];

/// For each document: type of its root, title, and purpose.
const DOCUMENTS: [(&str, &str, &str); 7] = [
    (
        "Profile",
        "Profile",
        "Describes a scanner; `phasmid serve --profile`, `phasmid profile check`. With `extends = \"NAME\"`, it \
         has everything of [another profile](../guides/own-scanner.md#extend-another-profile) that it does \
         not say itself.",
    ),
    (
        "Scene",
        "Scene",
        "Describes what the scanner sees; `phasmid serve --scene`, `phasmid scene check`. With \
         `extends = \"NAME\"`, it has everything of another scene that it does not say itself.",
    ),
    (
        "Station",
        "Station",
        "Describes several devices in one scene; `phasmid serve --profile`.",
    ),
    (
        "Manifest",
        "Manifest",
        "Lists the projected patterns; `phasmid decode --manifest`, `phasmid serve --sequence`.",
    ),
    (
        "Rig",
        "Calibration",
        "Gives lenses and poses of camera and projector; `calibration.toml` of `phasmid calibrate` and \
         `phasmid scan`, `phasmid decode --calibration`.",
    ),
    (
        "Patient",
        "Patient",
        "Describes a generated patient; `phasmid patient check`, `phasmid patient plan`.",
    ),
    (
        "Schedule",
        "Faults",
        "Describes what goes wrong and when; `phasmid serve --faults`.",
    ),
];

/// A struct or enum that is read from a file.
struct Definition {
    attributes: Vec<Attribute>,
    shape: Shape,
    /// Default values from functions and `impl Default` blocks of the same file, by the name of the
    /// function or field.
    defaults: Defaults,
}

type Defaults = Rc<HashMap<String, Expr>>;

enum Shape {
    Struct(Vec<Field>),
    Enum(Vec<syn::Variant>),
}

/// Returns the types by name, and the constants of all files.
fn definitions() -> (HashMap<String, Definition>, HashMap<String, Expr>) {
    let mut files = Vec::new();
    let mut open: Vec<_> = SOURCES.iter().map(|path| root().join(path)).collect();
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(
                std::fs::read_dir(&path)
                    .unwrap()
                    .map(|entry| entry.unwrap().path()),
            );
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    let mut found = HashMap::new();
    let mut constants = HashMap::new();
    for path in files {
        let text =
            std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let items = syn::parse_file(&text).unwrap().items;
        let defaults: Defaults = Rc::new(items.iter().flat_map(defaults).collect());
        let here = items.iter().filter(|item| matches!(item, Item::Const(_)));
        constants.extend(here.flat_map(self::defaults));
        for item in items {
            let (name, attributes, shape) = match item {
                Item::Struct(item) => {
                    let fields = match item.fields {
                        Fields::Named(fields) => fields.named.into_iter().collect(),
                        // A type that is read as another type has no fields of its own.
                        _ if serde(&item.attrs, "try_from").is_some() => Vec::new(),
                        _ => continue,
                    };
                    (item.ident, item.attrs, Shape::Struct(fields))
                }
                Item::Enum(item) => (
                    item.ident,
                    item.attrs,
                    Shape::Enum(item.variants.into_iter().collect()),
                ),
                _ => continue,
            };
            let derived = |attribute: &Attribute| {
                attribute.path().is_ident("derive")
                    && matches!(&attribute.meta, Meta::List(list) if list.tokens.to_string().contains("Deserialize"))
            };
            if attributes.iter().any(derived) {
                let definition = Definition {
                    attributes,
                    shape,
                    defaults: Rc::clone(&defaults),
                };
                let before = found.insert(name.to_string(), definition);
                assert!(before.is_none(), "two types {name}");
            }
        }
    }
    (found, constants)
}

/// Returns the names and values that an item defines: a constant, a function's last expression, or
/// `Type.field` of an `impl Default`.
fn defaults(item: &Item) -> Vec<(String, Expr)> {
    let last = |block: &syn::Block| match block.stmts.last() {
        Some(Stmt::Expr(expr, None)) => Some(expr.clone()),
        _ => None,
    };
    match item {
        Item::Const(item) => vec![(item.ident.to_string(), (*item.expr).clone())],
        Item::Fn(item) => {
            let value = last(&item.block);
            value
                .map(|expr| (item.sig.ident.to_string(), expr))
                .into_iter()
                .collect()
        }
        Item::Impl(item)
            if item
                .trait_
                .as_ref()
                .is_some_and(|(_, path, _)| path.is_ident("Default")) =>
        {
            let (name, _) = split(&item.self_ty);
            let functions = item.items.iter().filter_map(|item| match item {
                ImplItem::Fn(function) => last(&function.block),
                _ => None,
            });
            let fields = functions.filter_map(|expr| match expr {
                Expr::Struct(value) => Some(value.fields),
                _ => None,
            });
            let fields = fields.flatten().filter_map(|field| match field.member {
                syn::Member::Named(member) => Some((format!("{name}.{member}"), field.expr)),
                syn::Member::Unnamed(_) => None,
            });
            fields.collect()
        }
        _ => Vec::new(),
    }
}

/// Returns the documentation as one line; links to items become code.
fn documentation(attributes: &[Attribute]) -> String {
    let mut out = String::new();
    for attribute in attributes.iter().filter(|a| a.path().is_ident("doc")) {
        if let Meta::NameValue(doc) = &attribute.meta
            && let Expr::Lit(literal) = &doc.value
            && let Lit::Str(text) = &literal.lit
        {
            out.push_str(text.value().trim());
            out.push(' ');
        }
    }
    let mut text = String::new();
    for (at, part) in out.trim().split("[`").enumerate() {
        match part.split_once("`]") {
            Some((item, rest)) if at > 0 => {
                let rest = match rest.strip_prefix('(') {
                    Some(path) => path.split_once(')').map_or("", |(_, rest)| rest),
                    None => rest,
                };
                write!(text, "`{item}`{rest}").unwrap();
            }
            _ => text.push_str(part),
        }
    }
    text.replace('|', "\\|")
}

/// Returns the value of a key in the serde attributes, or an empty text for a bare word.
fn serde(attributes: &[Attribute], key: &str) -> Option<String> {
    let mut found = None;
    for attribute in attributes.iter().filter(|a| a.path().is_ident("serde")) {
        attribute
            .parse_nested_meta(|meta| {
                if meta.input.peek(syn::token::Paren) {
                    // `bound(...)`
                    return meta.parse_nested_meta(|inner| inner.value()?.parse().map(|_: Lit| ()));
                }
                let value = match meta.value() {
                    Ok(value) => value.parse::<syn::LitStr>()?.value(),
                    Err(_) => String::new(),
                };
                if meta.path.is_ident(key) {
                    found = Some(value);
                }
                Ok(())
            })
            .unwrap();
    }
    found
}

/// Returns the name of a variant in a file.
fn variant_name(variant: &syn::Variant, rename_all: Option<&str>) -> String {
    let name = variant.ident.to_string();
    serde(&variant.attrs, "rename").unwrap_or_else(|| match rename_all {
        Some("lowercase") => name.to_lowercase(),
        Some("kebab-case") => {
            let mut out = String::new();
            for (at, c) in name.char_indices() {
                if at > 0 && c.is_uppercase() {
                    out.push('-');
                }
                out.extend(c.to_lowercase());
            }
            out
        }
        None => name,
        Some(other) => panic!("rename_all = {other}"),
    })
}

/// Returns the last segment of a type's path and its type arguments.
fn split(ty: &Type) -> (String, Vec<&Type>) {
    let Type::Path(path) = ty else {
        panic!("not a path");
    };
    let last = path.path.segments.last().unwrap();
    let arguments = match &last.arguments {
        PathArguments::AngleBracketed(list) => list
            .args
            .iter()
            .filter_map(|argument| match argument {
                GenericArgument::Type(ty) => Some(ty),
                _ => None,
            })
            .collect(),
        _ => Vec::new(),
    };
    (last.ident.to_string(), arguments)
}

/// Maximum number of values of a text that are listed in the field's own row. A text with more
/// values gets a section with their documentation.
const VALUES_IN_ROW: usize = 4;
/// Text for the default of a table whose fields all have defaults.
const FIELDS: &str = "defaults of its fields";

/// Writes the sections of a document: one for each table that it may contain, and for each text with
/// many values.
struct Document<'a> {
    types: &'a HashMap<String, Definition>,
    constants: &'a HashMap<String, Expr>,
    /// Short name of the document, at the start of each heading.
    name: &'a str,
    /// Paths of the tables and texts that are already described, by type.
    described: HashMap<String, String>,
    /// Tables and texts to describe: path in the file, and type.
    waiting: Vec<(String, String)>,
    out: String,
}

impl Document<'_> {
    /// Returns how a value of a type is written at `path`, and queues the tables in it.
    fn value(&mut self, ty: &Type, path: &str) -> String {
        if let Type::Array(array) = ty {
            let Expr::Lit(length) = &array.len else {
                panic!("{path}: length of an array");
            };
            let Lit::Int(length) = &length.lit else {
                panic!("{path}: length of an array");
            };
            let inner = self.value(&array.elem, path);
            return format!("{length} x {inner}");
        }
        let (name, arguments) = split(ty);
        match name.as_str() {
            "f64" | "f32" => "number".into(),
            "u8" | "u16" | "u32" | "u64" | "usize" | "i32" | "i64" => "integer".into(),
            "bool" => "boolean".into(),
            "String" => "text".into(),
            "DVec2" => "2 x number".into(),
            "DVec3" => "3 x number".into(),
            "DMat3" => "3 x 3 x number".into(),
            "PathBuf" => "file".into(),
            "Option" | "Box" => self.value(arguments[0], path),
            "Vec" => match self.value(arguments[0], &format!("{path}[]")) {
                inner if inner.starts_with("[table]") => inner.replacen("table", "tables", 1),
                inner => format!("array of {inner}"),
            },
            name => {
                let find = |name: &str| {
                    let found = self.types.get(name);
                    found.unwrap_or_else(|| panic!("{path}: type {name}"))
                };
                let mut name = name.to_owned();
                while let Some(path) = serde(&find(&name).attributes, "try_from") {
                    name = path.rsplit("::").next().unwrap().to_owned();
                }
                let name = name.as_str();
                let definition = find(name);
                let rename_all = serde(&definition.attributes, "rename_all");
                let is_unit = |v: &syn::Variant| matches!(v.fields, Fields::Unit);
                let kind = match &definition.shape {
                    Shape::Enum(variants) if variants.iter().all(is_unit) => "text",
                    _ => "table",
                };
                match &definition.shape {
                    Shape::Enum(variants) if kind == "text" && variants.len() <= VALUES_IN_ROW => {
                        let rename_all = rename_all.as_deref();
                        let names = variants
                            .iter()
                            .map(|v| format!("`\"{}\"`", variant_name(v, rename_all)));
                        names.collect::<Vec<_>>().join(", ")
                    }
                    _ => {
                        let known = self.described.entry(name.to_owned()).or_insert_with(|| {
                            self.waiting.push((path.to_owned(), name.to_owned()));
                            path.to_owned()
                        });
                        format!("[{kind}](#{})", anchor(self.name, known))
                    }
                }
            }
        }
    }

    /// Returns how a default value is written in a file.
    fn written(&self, expr: &Expr) -> String {
        match expr {
            Expr::Lit(literal) => match &literal.lit {
                Lit::Int(value) => value.to_string().replace('_', ""),
                Lit::Float(value) => value.base10_digits().to_owned(),
                Lit::Str(value) => format!("\"{}\"", value.value()),
                Lit::Bool(value) => value.value.to_string(),
                _ => panic!("a default that is neither number, text nor boolean"),
            },
            Expr::MethodCall(call) => self.written(&call.receiver),
            // `String::new()`, `Type::default()`, `function(...)`.
            Expr::Call(call) => match call.func.as_ref() {
                Expr::Path(path) if path.path.segments[0].ident == "String" => "\"\"".into(),
                Expr::Path(path) if path.path.segments.len() == 1 => "computed".into(),
                _ => FIELDS.into(),
            },
            // A variant of an enumeration of tables.
            Expr::Struct(variant) => {
                let name = &variant.path.segments.last().unwrap().ident;
                format!("{{ kind = \"{}\" }}", name.to_string().to_lowercase())
            }
            Expr::Array(array) => {
                let entries: Vec<_> = array
                    .elems
                    .iter()
                    .map(|entry| self.written(entry))
                    .collect();
                format!("[{}]", entries.join(", "))
            }
            Expr::Path(path) => {
                let names: Vec<String> = path
                    .path
                    .segments
                    .iter()
                    .map(|s| s.ident.to_string())
                    .collect();
                let [.., outer, name] = names.as_slice() else {
                    return "absent".into();
                };
                let Some(definition) = self.types.get(outer) else {
                    return self.written(&self.constants[name]);
                };
                let Shape::Enum(variants) = &definition.shape else {
                    panic!("{outer}::{name}");
                };
                let variant = variants.iter().find(|v| v.ident == name).unwrap();
                let rename_all = serde(&definition.attributes, "rename_all");
                format!("\"{}\"", variant_name(variant, rename_all.as_deref()))
            }
            _ => panic!("a default that is no literal"),
        }
    }

    /// Returns the default of a field, or "required".
    fn default(&self, field: &Field, owner: &str) -> String {
        let definition = &self.types[owner];
        let name = field.ident.as_ref().unwrap();
        if serde(&definition.attributes, "default").is_some()
            && let Some(expr) = definition.defaults.get(&format!("{owner}.{name}"))
        {
            let text = self.written(expr);
            return match text.as_str() {
                "absent" | "computed" | FIELDS => text,
                _ => format!("`{text}`"),
            };
        }
        let by_container = serde(&definition.attributes, "default").is_some();
        let zero = |ty: &Type| match ty {
            Type::Array(_) => "zeros".to_owned(),
            ty => match split(ty).0.as_str() {
                "Option" => "absent".into(),
                "Vec" => "empty".into(),
                "bool" => "`false`".into(),
                "f64" | "f32" | "u8" | "u16" | "u32" | "u64" => "`0`".into(),
                "String" => "`\"\"`".into(),
                _ => FIELDS.into(),
            },
        };
        match serde(&field.attrs, "default") {
            Some(function) if !function.is_empty() => {
                format!("`{}`", self.written(&definition.defaults[&function]))
            }
            Some(_) => zero(&field.ty),
            None if by_container => zero(&field.ty),
            None => match &field.ty {
                Type::Path(_) if split(&field.ty).0 == "Option" => "absent".into(),
                _ => "required".into(),
            },
        }
    }

    /// Writes the rows of a table's fields.
    fn rows<'f>(&mut self, fields: impl IntoIterator<Item = &'f Field>, path: &str, owner: &str) {
        let head = "| field | value | default | meaning |\n| --- | --- | --- | --- |";
        writeln!(self.out, "{head}").unwrap();
        let read = |field: &&Field| serde(&field.attrs, "skip").is_none();
        for field in fields.into_iter().filter(read) {
            let name = field.ident.as_ref().unwrap().to_string();
            let inner = match path {
                "" => name.clone(),
                path => format!("{path}.{name}"),
            };
            if serde(&field.attrs, "flatten").is_some() {
                let meaning = documentation(&field.attrs);
                let at = anchor(self.name, &inner);
                let row = format!("| `{name}` | [text](#{at}) | required | {meaning} |");
                writeln!(self.out, "{row}").unwrap();
                self.waiting.push((inner, "What".to_owned()));
                continue;
            }
            // The entries of this list are written in another form than they are stored.
            let frames: Type = syn::parse_str("Vec<Entry>").unwrap();
            let ty = match serde(&field.attrs, "deserialize_with") {
                Some(function) if function.ends_with("written::frames") => &frames,
                _ => &field.ty,
            };
            let value = self.value(ty, &inner);
            let default = self.default(field, owner);
            let meaning = documentation(&field.attrs);
            writeln!(self.out, "| `{name}` | {value} | {default} | {meaning} |").unwrap();
        }
        self.out.push('\n');
    }

    /// Writes the kinds of faults, and the fields that each adds to the table of a fault.
    fn faults(&mut self, path: &str) {
        writeln!(self.out, "### {}: `{path}`\n", self.name).unwrap();
        writeln!(
            self.out,
            "Kinds of faults, and the fields that a kind adds.\n"
        )
        .unwrap();
        writeln!(
            self.out,
            "| kind | field | values | default | meaning |\n| --- | --- | --- | --- | --- |"
        )
        .unwrap();
        for kind in Kind::ALL {
            writeln!(self.out, "| `{:?}` | | | | {} |", kind.name, kind.about).unwrap();
            for parameter in kind.parameters {
                let (name, about) = (parameter.name, parameter.about);
                let default = match kind.default(name) {
                    Some(value) => format!("`{value}`"),
                    None => "absent".to_owned(),
                };
                let allowed = parameter.allowed();
                writeln!(self.out, "| | `{name}` | {allowed} | {default} | {about} |").unwrap();
            }
        }
        self.out.push('\n');
    }

    fn section(&mut self, path: &str, owner: &str) {
        let types = self.types;
        if owner == "What" {
            return self.faults(path);
        }
        let definition = &types[owner];
        if !path.is_empty() {
            writeln!(self.out, "### {}: `{path}`\n", self.name).unwrap();
        }
        writeln!(self.out, "{}\n", documentation(&definition.attributes)).unwrap();
        match &definition.shape {
            Shape::Struct(fields) => {
                self.rows(fields, path, owner);
            }
            Shape::Enum(variants) => {
                let rename_all = serde(&definition.attributes, "rename_all");
                let tag = serde(&definition.attributes, "tag");
                for variant in variants {
                    let name = variant_name(variant, rename_all.as_deref());
                    let text = documentation(&variant.attrs);
                    match (&tag, &variant.fields) {
                        (Some(tag), Fields::Named(fields)) => {
                            writeln!(self.out, "**`{tag} = \"{name}\"`**: {text}\n").unwrap();
                            if !fields.named.is_empty() {
                                self.rows(&fields.named, path, owner);
                            }
                        }
                        (Some(tag), Fields::Unit) => {
                            writeln!(self.out, "**`{tag} = \"{name}\"`**: {text}\n").unwrap();
                        }
                        (None, Fields::Unnamed(fields)) => {
                            let value = self.value(&fields.unnamed[0].ty, path);
                            writeln!(self.out, "**`{name} = ...`** ({value}): {text}\n").unwrap();
                        }
                        (None, Fields::Unit) => {
                            writeln!(self.out, "- `\"{name}\"`: {text}").unwrap();
                        }
                        _ => panic!("{path}: variant {name}"),
                    }
                }
                self.out.push('\n');
            }
        }
    }
}

fn anchor(document: &str, path: &str) -> String {
    format!("{}-{path}", document.to_lowercase())
        .chars()
        .filter(|c| c.is_alphanumeric() || *c == '_' || *c == '-')
        .collect()
}

#[test]
fn the_reference_of_fields_is_the_code() {
    let (types, constants) = definitions();
    let mut page = String::from(
        "# Fields of files\n\nThis page is generated from the code that reads the files. All files are TOML. An unknown field, a missing required field or a value out of range is rejected with file, line and allowed range. `a.b[]` means the tables `[[a.b]]`. Dialect files have [a page of their own](dialect-file.md).\n\n",
    );
    let mut anchors = HashSet::new();
    for (name, title, purpose) in DOCUMENTS {
        let mut document = Document {
            types: &types,
            constants: &constants,
            name: title,
            described: HashMap::new(),
            waiting: vec![(String::new(), name.to_owned())],
            out: format!("## {title}\n\n{purpose} "),
        };
        while !document.waiting.is_empty() {
            let (path, name) = document.waiting.remove(0);
            document.section(&path, &name);
            assert!(
                path.is_empty() || anchors.insert(anchor(title, &path)),
                "{title}: two sections {path}"
            );
        }
        page += &document.out;
    }
    super::assert_generated("reference/fields.md", &format!("{}\n", page.trim_end()));
}
