//! The content of a YAML, XML or TOML file as one tree, whose errors name file, line and key.

use std::fmt;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use quick_xml::events::Event;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

use crate::{IoError, read};

/// A value of a file.
#[derive(Debug, Clone, PartialEq)]
enum Value {
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// A value and its line, from 1; 0 if it is not known.
#[derive(Debug, Clone, PartialEq)]
struct Node {
    line: usize,
    value: Value,
}

/// The tree of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Document(Node);

/// A place in the tree, with what its errors name.
#[derive(Debug, Clone)]
pub(super) struct Entry<'a> {
    path: &'a Path,
    key: String,
    node: &'a Node,
}

/// How deep lists, maps and elements may be nested: a bound on the stack; calibrations need four or five levels.
const MAX_NESTING: usize = 32;

impl Document {
    /// A YAML text. OpenCV's head `%YAML:1.0`, which no YAML parser takes, is skipped.
    pub(super) fn yaml(text: &str, path: &Path) -> Result<Self, IoError> {
        let bare = text.strip_prefix("%YAML:").map(|rest| format!("# {rest}"));
        let options = serde_saphyr::options! {
            with_snippet: false,
            budget: serde_saphyr::budget! { max_depth: MAX_NESTING },
        };
        let tree =
            serde_saphyr::from_str_with_options::<Spanned<Value>>(bare.as_deref().unwrap_or(text), options);
        let tree = tree.map_err(|error| {
            let line = error.location().map_or(0, |l| l.line());
            let refused = IoError::new(path, format_args!("is no YAML: {error}"), "correct the file");
            at(refused, usize::try_from(line).unwrap_or(0))
        })?;
        Ok(Self(tree.into()))
    }

    /// A TOML text.
    pub(super) fn toml(text: &str, path: &Path) -> Result<Self, IoError> {
        let line = |byte: usize| 1 + text.bytes().take(byte).filter(|&b| b == b'\n').count();
        let table = toml::de::DeTable::parse(text).map_err(|error| {
            let refused =
                IoError::new(path, format_args!("is no TOML: {}", error.message()), "correct the file");
            at(refused, error.span().map_or(0, |s| line(s.start)))
        })?;
        let entries = table.get_ref().iter();
        let entries = entries.map(|(key, value)| (key.get_ref().to_string(), of_toml(value, &line)));
        Ok(Self(Node { line: 1, value: Value::Map(entries.collect()) }))
    }

    /// An XML text; attributes are left out.
    pub(super) fn xml(text: &str, path: &Path) -> Result<Self, IoError> {
        let mut reader = quick_xml::Reader::from_str(text);
        let line = |byte: u64| 1 + text.bytes().take(byte as usize).filter(|&b| b == b'\n').count();
        let refuse = |reason: String, byte| {
            IoError::new(path, format_args!("is no XML: {reason}"), "correct the file").at_line(line(byte))
        };
        // Elements that have begun: name, byte, text, children.
        type Open = (String, u64, String, Vec<(String, Node)>);
        let mut open: Vec<Open> = vec![Default::default()];
        loop {
            let event = reader.read_event().map_err(|e| refuse(e.to_string(), reader.error_position()))?;
            let here = reader.buffer_position();
            match event {
                Event::Start(tag) if open.len() > MAX_NESTING => {
                    return Err(refuse(format!("{:?} is nested too deep", tag.name()), here));
                }
                Event::Start(tag) => {
                    let name = tag.name().as_ref().to_string();
                    open.push((name, here, String::new(), Vec::new()));
                }
                Event::Text(text) => {
                    if let Some((_, _, whole, _)) = open.last_mut() {
                        whole.push_str(&text);
                    }
                }
                Event::End(_) if open.len() > 1 => {
                    let Some((name, byte, text, children)) = open.pop() else { break };
                    let value =
                        if children.is_empty() { scalar(text.trim().into()) } else { Value::Map(children) };
                    if let Some((_, _, _, siblings)) = open.last_mut() {
                        siblings.push((name, Node { line: line(byte), value }));
                    }
                }
                Event::Eof => break,
                _ => {}
            }
        }
        match (open.len(), open.pop()) {
            (1, Some((_, _, _, children))) => Ok(Self(Node { line: 1, value: Value::Map(children) })),
            _ => Err(refuse("it ends within an element".into(), text.len() as u64)),
        }
    }

    /// A tree without anything.
    pub(super) fn empty() -> Self {
        Self(Node { line: 0, value: Value::Map(Vec::new()) })
    }

    /// Its root; `path` names it in errors.
    pub(super) fn root<'a>(&'a self, path: &'a Path) -> Entry<'a> {
        Entry { path, key: String::new(), node: &self.0 }
    }
}

/// An error at a line, if that is known.
fn at(error: IoError, line: usize) -> IoError {
    if line > 0 { error.at_line(line) } else { error }
}

fn scalar(text: String) -> Value {
    text.parse().map_or(Value::Text(text), Value::Number)
}

fn of_toml(value: &toml::Spanned<toml::de::DeValue<'_>>, line: &impl Fn(usize) -> usize) -> Node {
    use toml::de::DeValue;
    let made = match value.get_ref() {
        DeValue::Integer(number) => scalar(number.to_string()),
        DeValue::Float(number) => scalar(number.to_string()),
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Boolean(truth) => Value::Text(truth.to_string()),
        DeValue::Datetime(time) => Value::Text(time.to_string()),
        DeValue::Array(values) => Value::List(values.iter().map(|v| of_toml(v, line)).collect()),
        DeValue::Table(table) => {
            let entry = |(key, value): (&toml::Spanned<toml::de::DeString<'_>>, &_)| {
                (key.get_ref().to_string(), of_toml(value, line))
            };
            Value::Map(table.iter().map(entry).collect())
        }
    };
    Node { line: line(value.span().start), value: made }
}

impl From<Spanned<Value>> for Node {
    fn from(spanned: Spanned<Value>) -> Self {
        Self { line: usize::try_from(spanned.referenced.line()).unwrap_or(0), value: spanned.value }
    }
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValueVisitor)
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a text, a list or a map")
    }

    fn visit_bool<E>(self, truth: bool) -> Result<Value, E> {
        Ok(Value::Text(truth.to_string()))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Value, E> {
        Ok(Value::Number(number as f64))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Value, E> {
        Ok(Value::Number(number as f64))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Value, E> {
        Ok(Value::Number(number))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        // OpenCV writes `1.` and the like.
        Ok(scalar(text.to_owned()))
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Text(String::new()))
    }

    fn visit_none<E>(self) -> Result<Value, E> {
        Ok(Value::Text(String::new()))
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        Value::deserialize(deserializer)
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        Value::deserialize(deserializer)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element::<Spanned<Value>>()? {
            list.push(item.into());
        }
        Ok(Value::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Vec::new();
        while let Some((key, value)) = entries.next_entry::<String, Spanned<Value>>()? {
            map.push((key, value.into()));
        }
        Ok(Value::Map(map))
    }
}

impl<'a> Entry<'a> {
    /// The entry of a map under any of `names`, the first that is there.
    pub(super) fn find(&self, names: &[&str]) -> Option<Entry<'a>> {
        let Value::Map(entries) = &self.node.value else { return None };
        let found = |name: &&str| entries.iter().find(|(key, _)| key == name);
        let (key, node) = names.iter().find_map(found)?;
        let key = if self.key.is_empty() { key.clone() } else { format!("{}.{key}", self.key) };
        Some(Entry { path: self.path, key, node })
    }

    /// The same, which must be there.
    pub(super) fn get(&self, names: &[&str]) -> Result<Entry<'a>, IoError> {
        let within = if self.key.is_empty() { String::new() } else { format!(" in {}", self.key) };
        let missing = || {
            let reason = format_args!("the key {}{within} is missing", names.join(" or ")).to_string();
            at(IoError::new(self.path, reason, "add it, or give a complete calibration"), self.node.line)
        };
        self.find(names).ok_or_else(missing)
    }

    /// An error at this entry.
    pub(super) fn refuse(&self, reason: impl fmt::Display, advice: impl fmt::Display) -> IoError {
        let colon = if self.key.is_empty() { "" } else { ": " };
        at(IoError::new(self.path, format_args!("{}{colon}{reason}", self.key), advice), self.node.line)
    }

    /// A text; a number has none.
    pub(super) fn text(&self) -> Result<&'a str, IoError> {
        match &self.node.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.refuse("is no text", "give a word")),
        }
    }

    /// One finite number.
    pub(super) fn number(&self) -> Result<f64, IoError> {
        match self.all_numbers()?.as_slice() {
            [number] => Ok(*number),
            other => Err(self.refuse(format_args!("{} numbers, not one", other.len()), "give one number")),
        }
    }

    /// All finite numbers of a list, of a list of lists, of a text, or of a matrix with `data`.
    pub(super) fn all_numbers(&self) -> Result<Vec<f64>, IoError> {
        let mut found = Vec::new();
        let entry = self.find(&["data"]).unwrap_or_else(|| self.clone());
        collect(entry.node, &mut found).map_err(|reason| self.refuse(reason, "give numbers"))?;
        Ok(found)
    }

    /// N finite numbers.
    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], IoError> {
        let found = self.all_numbers()?;
        found.try_into().map_err(|found: Vec<f64>| {
            self.refuse(format_args!("{} numbers, not {N}", found.len()), format_args!("give {N} numbers"))
        })
    }

    /// A 3×3 matrix, row by row.
    pub(super) fn matrix(&self) -> Result<Matrix3<f64>, IoError> {
        Ok(Matrix3::from_row_slice(&self.numbers::<9>()?))
    }

    /// A rigid motion as a 4×4 matrix (3×4 does), row by row.
    pub(super) fn motion(&self) -> Result<egomotion::geometry::RigidMotion, IoError> {
        let m = self.all_numbers()?;
        if m.len() != 16 && m.len() != 12 {
            let reason = format_args!("{} numbers, not 16", m.len()).to_string();
            return Err(self.refuse(reason, "give the 4x4 matrix of a rigid motion"));
        }
        let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
        self.rigid(rotation, Vector3::new(m[3], m[7], m[11]))
    }

    /// A rigid motion, if the matrix is a rotation up to the rounding of a file.
    pub(super) fn rigid(
        &self,
        rotation: Matrix3<f64>,
        translation: Vector3<f64>,
    ) -> Result<egomotion::geometry::RigidMotion, IoError> {
        let near = egomotion::geometry::RigidMotion::nearest_rotation(&rotation);
        match near.filter(|near| (near - rotation).amax() < 1e-3) {
            Some(rotation) => Ok(egomotion::geometry::RigidMotion { rotation, translation }),
            None => Err(self.refuse("is no rotation", "correct the calibration")),
        }
    }
}

fn collect(node: &Node, into: &mut Vec<f64>) -> Result<(), String> {
    match &node.value {
        Value::Number(number) if number.is_finite() => into.push(*number),
        Value::Number(number) => return Err(format!("{number} is not a finite number")),
        Value::Text(text) => into.extend(read::numbers(text)?),
        Value::List(items) => items.iter().try_for_each(|item| collect(item, into))?,
        Value::Map(_) => return Err("is a map, not numbers".into()),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_syntaxes_one_tree() {
        let path = Path::new("a");
        let yaml = "%YAML:1.0\n---\na: 1.\nm: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: d\n   data: [ 2., -3.5e-01 ]\nt: word\n";
        let xml = "<?xml version=\"1.0\"?>\n<a>1.</a>\n<m type_id=\"opencv-matrix\"><rows>1</rows><cols>2</cols><dt>d</dt>\n<data>\n  2. -3.5e-01</data></m>\n<t>word</t>";
        let toml = "a = 1\n[m]\ndata = [2, -0.35]\n";
        for document in [
            Document::yaml(yaml, path).unwrap(),
            Document::xml(xml, path).unwrap(),
            Document::toml(toml, path).unwrap(),
        ] {
            let root = document.root(path);
            assert_eq!(root.get(&["b", "a"]).unwrap().number().unwrap(), 1.0);
            assert_eq!(root.get(&["m"]).unwrap().numbers::<2>().unwrap(), [2.0, -0.35]);
            assert_eq!(root.find(&["t"]).map_or("word", |t| t.text().unwrap()), "word");
        }
    }

    #[test]
    fn errors_name_line_and_key() {
        let path = Path::new("c.yaml");
        let document = Document::yaml("cam0:\n  f: [1, x]\n  g: nan\n", path).unwrap();
        let cam = document.root(path).get(&["cam0"]).unwrap();
        let message = |entry: &str| cam.get(&[entry]).unwrap().all_numbers().unwrap_err().to_string();
        assert!(message("f").starts_with("c.yaml:2: cam0.f: \"x\" is not a number"), "{}", message("f"));
        assert!(message("g").starts_with("c.yaml:3: cam0.g: "), "{}", message("g"));
        assert!(cam.get(&["h", "i"]).unwrap_err().to_string().contains("the key h or i in cam0 is missing"));
        assert!(Document::yaml("a: [1, 2\nb: 3", path).is_err());
        assert!(Document::yaml("a: 1\nb: .nan", path).is_err());
        assert!(
            Document::toml("a = 1\nb = = 2", path)
                .unwrap_err()
                .to_string()
                .starts_with("c.yaml:2: is no TOML")
        );
        assert!(Document::xml("<a><b>1</b>", path).is_err());
        for deep in ["[".repeat(100_000), "- ".repeat(100_000), "{a: ".repeat(50_000)] {
            assert!(Document::yaml(&deep, path).is_err());
        }
        assert!(Document::xml(&"<a>".repeat(100_000), path).is_err());
        assert!(Document::toml(&format!("a = {}", "[".repeat(100_000)), path).is_err());
    }
}
