//! docs/guide/training.md names every hyper-parameter, and none that there is not.

use particlegs_core::model::LawKind;
use particlegs_train::{Config, Preset};
use serde_json::Value;
use std::collections::BTreeSet;

/// Names of all numbers, as the guide writes them.
fn names(value: &Value, prefix: &str, into: &mut BTreeSet<String>) {
    match value {
        Value::Object(table) => table.iter().for_each(|(key, value)| {
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            names(value, &name, into);
        }),
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            items.iter().for_each(|item| names(item, &format!("{prefix}[]"), into));
        }
        _ => {
            into.insert(prefix.to_string());
        }
    }
}

#[test]
fn the_guide_names_every_hyper_parameter() {
    let guide = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/guide/training.md");
    let guide = std::fs::read_to_string(guide).unwrap();
    let mut hyper_parameters = BTreeSet::new();
    for config in [Config::preset(Preset::Paper, LawKind::AlphaBlend), Config::fine_tuning()] {
        names(&serde_json::to_value(config).unwrap(), "", &mut hyper_parameters);
    }
    let table = guide.split("## Hyper-parameters").nth(1).unwrap();
    let rows = table.lines().filter_map(|l| l.strip_prefix("| `")?.split_once('`'));
    let documented_names: BTreeSet<String> = rows.map(|(name, _)| name.to_string()).collect();
    let missing: Vec<_> = hyper_parameters.difference(&documented_names).collect();
    let stale: Vec<_> = documented_names.difference(&hyper_parameters).collect();
    assert!(missing.is_empty() && stale.is_empty(), "not in the guide: {missing:?}; only there: {stale:?}");
}
