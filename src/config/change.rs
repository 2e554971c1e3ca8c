//! Changes a value of a TOML document by the path of its key, written as in error
//! messages: `layer[0].grain[1].size_um.min`.
use toml::{Table, Value};

/// Sets the key at `path` to `value`. Missing tables are created, and the index after
/// the last entry of a list appends to the list.
///
/// # Errors
/// A message that says why `path` does not name a key of the document.
pub(super) fn set(table: &mut Table, path: &str, value: Value) -> Result<(), String> {
    let (key, rest) = path.split_once('.').unwrap_or((path, ""));
    let (name, indices) = key.split_once('[').unwrap_or((key, ""));
    if name.is_empty() {
        return Err("has an empty key in its path".into());
    }
    let new = match indices {
        "" => Value::Table(Table::new()),
        _ => Value::Array(Vec::new()),
    };
    let mut node = table.entry(name).or_insert(new);
    if !indices.is_empty() {
        let index = indices.strip_suffix(']').and_then(|i| i.parse().ok());
        let index: usize = index.ok_or("has an invalid index; write [0], [1], ...")?;
        let list = node.as_array_mut();
        let list =
            list.ok_or_else(|| format!("has an index after `{name}`, which is not a list"))?;
        if index == list.len() {
            list.push(Value::Table(Table::new()));
        }
        let length = list.len();
        node = list.get_mut(index).ok_or_else(|| {
            format!("is beyond the end of `{name}`, which has {length} entries in this sample")
        })?;
    }
    if rest.is_empty() {
        *node = value;
        return Ok(());
    }
    let inner = node.as_table_mut();
    let inner = inner.ok_or_else(|| format!("has a key below `{key}`, which is not a table"))?;
    set(inner, rest, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(path: &str, value: i64) -> Result<String, String> {
        let mut table = Table::new();
        let inner = Table::from_iter([("b".to_owned(), Value::Integer(1))]);
        table.insert("a".into(), Value::Array(vec![Value::Table(inner)]));
        set(&mut table, path, Value::Integer(value))?;
        Ok(table.to_string().replace('\n', " "))
    }

    #[test]
    fn keys_are_changed_and_added() {
        let cases = [
            ("a[0].b", "[[a]] b = 7 "),
            ("a[0].c", "[[a]] b = 1 c = 7 "),
            ("a[0].c.d", "[[a]] b = 1  [a.c] d = 7 "),
            ("a[1].b", "[[a]] b = 1  [[a]] b = 7 "),
            ("a", "a = 7 "),
            ("c[0].d", "[[a]] b = 1  [[c]] d = 7 "),
        ];
        for (path, expected) in cases {
            assert_eq!(changed(path, 7).as_deref(), Ok(expected), "{path}");
        }
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused() {
        for path in [
            "",
            ".a",
            "a[2].b",
            "a[x]",
            "a[0",
            "a.b",
            "a[0].b.c",
            "a[0].b[0]",
        ] {
            assert!(changed(path, 7).is_err(), "{path}");
        }
    }
}
