//! Snapshots of text formats: a table, its columns as fields, species by a column.

use super::lines::of_block;
use super::parse::{self, RowParser, RowPlan, Scaling};
use super::reader::RowReader;
use super::split::{kind_of, shown, tokens};
use super::table::{MOST_SPECIES, TextTable};
use crate::axes::axis;
use crate::fields::number_of;
use crate::{Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, TextResult, wrapping};
use particlegs_core::space::PeriodicCell;
use particlegs_core::{Error, Hint, Result};
use particlegs_particles::{Number, SnapshotReader};
use std::sync::Arc;

pub struct TextSnapshot {
    description: Description,
    table: Arc<TextTable>,
    /// The columns that hold positions in units of a cell, and the cell.
    scaled: Option<([&'static [&'static str]; 3], Scaling)>,
    wraps: bool,
}

pub struct TableColumns {
    pub fields: Vec<SpeciesField>,
    /// The field or fields that hold positions; empty where none is known to.
    pub positions: String,
    pub mass: Option<String>,
}

impl TextSnapshot {
    /// `description` without its species, which come from the table: called `all` where there is one,
    /// else by `noun` and the value of the key column.
    pub fn new(
        mut description: Description,
        table: TextTable,
        mut columns: TableColumns,
        all: &str,
        noun: &str,
    ) -> Self {
        let mut kinds = kinds(&table).into_iter();
        for field in &mut columns.fields {
            let column_kinds = kinds.by_ref().take(field.components as usize);
            if column_kinds.filter(|kind| *kind == "u64").count() > 0 && field.kind == "i64" {
                field.kind = "u64".into();
            }
        }
        let mass = columns.mass.map_or(SpeciesMass::Unknown, SpeciesMass::Field);
        if table.keys.len() > MOST_SPECIES {
            description
                .notes
                .push(format!("more than {MOST_SPECIES} particle types: all particles are treated as one"));
        }
        let species = table.kinds.iter().filter(|kind| kind.count > 0).map(|kind| {
            // A type that is the only one may still be chosen by its name.
            let only = match &table.keys[..] {
                [only] => Some(only),
                _ => None,
            };
            let value = |key: &Vec<u8>| match key.is_empty() {
                true => "unnamed".into(),
                false => String::from_utf8_lossy(key).into_owned(),
            };
            let name = kind.key.as_ref().map_or(all.into(), |key| format!("{noun}{}", value(key)));
            let aliases = kind.key.as_ref().or(only).map_or(Vec::new(), |key| {
                let key = value(key).to_lowercase();
                let mut aliases = vec![format!("{}{key}", noun.trim_end()), format!("{noun}{key}"), key];
                aliases.sort();
                aliases.dedup();
                aliases
            });
            let (fields, positions) = (columns.fields.clone(), columns.positions.clone());
            Species { name, aliases, count: kind.count, mass: mass.clone(), positions, fields }
        });
        description.species = species.collect();
        TextSnapshot { description, table: Arc::new(table), scaled: None, wraps: false }
    }

    /// Positions in these columns, each of which may have several names, are in units of a cell.
    pub fn with_scaled(mut self, names: [&'static [&'static str]; 3], scaling: Scaling) -> Self {
        self.scaled = Some((names, scaling));
        self
    }

    /// Wraps positions into the periodic cell where their names, or the first rows, tell that they are `unwrapped`; with
    /// [`Choice::keep_unwrapped`] drops the cell.
    pub fn with_unwrapped(mut self, unwrapped: bool, choice: &Choice) -> Result<Self> {
        let mut description = std::mem::take(&mut self.description);
        let first = description.species.first().cloned();
        self.wraps = wrapping::settle(&mut description, choice, |periods| {
            unwrapped || first.is_some_and(|one| self.begins_unwrapped(&one, periods, choice))
        })?;
        self.description = description;
        Ok(self)
    }

    fn begins_unwrapped(&self, species: &Species, periods: &PeriodicCell, choice: &Choice) -> bool {
        let Ok(plan) = self.plan(species, choice) else { return false };
        let mut columns = <parse::ParticleColumns>::default();
        let mut parser = RowParser { layout: &self.table.layout, plan: &plan, skip: 0, room: wrapping::LOOKED_AT };
        // A broken row is the reader's to name.
        let _ = parser.block(&self.table.head, 1, &mut columns);
        let [x, y, z, _] = columns;
        let positions = x.iter().zip(&y).zip(&z).map(|((&x, &y), &z)| [x, y, z].map(f64::from));
        wrapping::leave(periods, positions)
    }

    fn plan(&self, species: &Species, choice: &Choice) -> Result<RowPlan> {
        let (positions, scaling) = self.positions(species, choice.positions.as_ref().unwrap_or(&species.positions))?;
        let weight = species.weight_field(&self.place(), &choice.weights)?;
        let weight = weight.map(|name| self.scalar(species, &name)).transpose()?;
        Ok(match choice.as_stored {
            false => RowPlan::new(positions, weight, scaling),
            true => RowPlan::new(positions, weight, None).with_bits_of(self.whole(species)),
        })
    }

    fn whole(&self, species: &Species) -> Vec<usize> {
        let columns = species.fields.iter().flat_map(|f| std::iter::repeat_n(f, f.components as usize)).enumerate();
        let is_whole = |f: &SpeciesField| matches!(number_of(f), Some(Number::I64 | Number::U64));
        columns.filter(|(_, f)| is_whole(f)).map(|(c, _)| c).collect()
    }

    fn place(&self) -> String {
        self.table.content.path().display().to_string()
    }

    /// The columns that the field or fields `name` are in, and whether they are scaled.
    fn positions(&self, species: &Species, name: &str) -> Result<([usize; 3], Option<Scaling>)> {
        if name.is_empty() {
            let scalars = species.fields.iter().filter(|f| f.components == 1 && f.kind != "text");
            let names: Vec<&str> = scalars.map(|f| &f.name[..]).collect();
            let hint = Hint::default().option("positions", "A,B,C");
            let hint = hint.words(format!(" names them; the columns are: {}", names.join(", ")));
            return Err(Error::input_with(self.place(), "no columns are named as positions", hint));
        }
        let vector = species.fields.iter().any(|f| f.name == name && f.components == 3);
        if let Some(first) = column_of(&species.fields, name).filter(|_| vector) {
            return Ok(([first, first + 1, first + 2], None));
        }
        let names: Vec<&str> = name.split(',').map(str::trim).collect();
        let all = || species.fields.iter().filter(|f| f.kind != "text").map(|f| &f.name[..]);
        let [x, y, z] = names[..] else { return Err(species.missing(&self.place(), name, all())) };
        let column = |n| self.scalar(species, n);
        let columns = [column(x)?, column(y)?, column(z)?];
        let Some((scaled, scaling)) = &self.scaled else { return Ok((columns, None)) };
        match [x, y, z].iter().zip(scaled).filter(|(n, scaled)| scaled.contains(n)).count() {
            0 => Ok((columns, None)),
            3 => Ok((columns, Some(*scaling))),
            _ => Err(Error::input(self.place(), format!("positions `{name}`: some are scaled and some are not"))),
        }
    }

    fn scalar(&self, species: &Species, name: &str) -> Result<usize> {
        let numbers = species.fields.iter().filter(|f| f.components == 1 && f.kind != "text").map(|f| &f.name[..]);
        let axis = axis(species, name).filter(|a| column_of(&species.fields, &a.field).is_some());
        let column = axis.and_then(|a| Some(column_of(&species.fields, &a.field)? + a.component as usize));
        column.ok_or_else(|| species.missing(&self.place(), name, numbers))
    }
}

fn column_of(fields: &[SpeciesField], name: &str) -> Option<usize> {
    let index = fields.iter().position(|f| f.name == name)?;
    Some(fields[..index].iter().map(|f| f.components as usize).sum())
}

impl Snapshot for TextSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let no_species = || Error::argument(format!("particle type {species} does not exist"));
        let one = self.description.species.get(species).ok_or_else(no_species)?;
        // The description leaves out kinds without rows, so that its numbers are not those of the table.
        let kinds = self.table.kinds.iter().enumerate().filter(|(_, kind)| kind.count > 0);
        let (kind, which) = kinds.clone().nth(species).ok_or_else(no_species)?;
        let key = self.table.key.zip(which.key.clone());
        let plan = self
            .plan(one, choice)?
            .wrapped(wrapping::cell(&self.description, choice)?.filter(|_| self.wraps))
            .with_key(key);
        Ok(Box::new(RowReader::new(self.table.clone(), kind, plan, self.description.meta.clone())?))
    }
}

/// Kinds of the columns of a table, by its first rows.
pub fn kinds(table: &TextTable) -> Vec<&'static str> {
    let rows = of_block(&table.head).map(|(line, _)| line).filter(|line| table.layout.is_row(line)).take(256);
    let rows: Vec<Vec<&[u8]>> = rows.map(|line| tokens(line, table.layout.separator)).collect();
    (0..table.layout.columns.len())
        .map(|c| kind_of(rows.iter().filter_map(|row| row.get(c).copied()), table.layout.comma))
        .collect()
}

/// A number in a header, or what is wrong with it.
pub fn header_number(token: &[u8]) -> TextResult<f64> {
    match super::split::number(token) {
        Some(value) if value.is_finite() => Ok(value),
        Some(_) => Err(format!("{} is not finite", shown(token))),
        None => Err(format!("{} is not a number", shown(token))),
    }
}
