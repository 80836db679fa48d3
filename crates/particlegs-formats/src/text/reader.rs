//! Rows of a table, run by run.

use super::lines::LineReader;
use super::parse::{LineError, ParticleColumns, RowParser, RowPlan, RowRule, TableNumber};
use super::table::TextTable;
use crate::pieces::origin_of;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{Chunk, RUN, RunSink, SnapshotMeta, SnapshotReader};
use std::ops::Range;
use std::sync::Arc;

/// Reads one species of a table. Plain files are parsed from any place by any thread; compressed
/// ones are decompressed by one thread while the others parse.
pub struct RowReader {
    table: Arc<TextTable>,
    kind: usize,
    plan: RowPlan,
    meta: SnapshotMeta,
}

/// Rows that are looked at, at each of some places, before all are read.
const SAMPLE: usize = 1024;
/// Most blocks of a stream that are parsed at once.
const BATCH: usize = 16;

impl RowReader {
    /// A reader of the species `kind`, positions about a point near those of all species.
    pub fn new(table: Arc<TextTable>, kind: usize, plan: RowPlan, meta: SnapshotMeta) -> Result<Self> {
        let mut reader = RowReader { table, kind, plan, meta };
        let origin = reader.sample()?.map(|column| origin_of(&column));
        reader.plan = reader.plan.about(origin);
        Ok(reader)
    }

    /// Positions of any species from the beginning and, in plain files, from three places more.
    /// Broken lines are found when they are read.
    fn sample(&self) -> Result<[Vec<f64>; 3]> {
        let mut columns = <ParticleColumns>::default();
        let plan = self.plan.clone().with_key(None);
        let mut look = |block: &[u8]| {
            let mut parser = RowParser { layout: &self.table.layout, plan: &plan, skip: 0, room: SAMPLE };
            let _ = parser.block(block, 1, &mut columns);
        };
        look(&self.table.head);
        let last = self.table.stretches.len().saturating_sub(1);
        for third in (1..=3).filter(|_| last > 0) {
            let mut lines = LineReader::open(&self.table.content, self.table.stretches[last * third / 3], None)?;
            look(lines.block()?.unwrap_or(&[]));
        }
        let [x, y, z, _] = columns;
        Ok([x, y, z].map(|column| column.into_iter().map(f64::from).collect()))
    }

    fn parser<'p>(&'p self, plan: &'p RowPlan, skip: u64, room: usize) -> RowParser<'p> {
        RowParser { layout: &self.table.layout, plan, skip, room }
    }

    fn fault(&self, fault: LineError) -> Error {
        Error::input(self.table.content.path(), format!("line {} {}", fault.line, fault.what))
    }

    fn changed(&self) -> Error {
        Error::input_with(self.table.content.path(), "the file changed while it was being read", "read it again")
    }

    fn length(&self, run: u64) -> usize {
        (self.count() - run * RUN as u64).min(RUN as u64) as usize
    }

    /// Parses run `run` of a plain file.
    fn run<T: TableNumber>(&self, run: u64, columns: &mut ParticleColumns<T>) -> Result<()> {
        let first = run * RUN as u64;
        let before = &self.table.before[self.kind];
        let stretch = before.partition_point(|&rows| rows <= first).saturating_sub(1);
        let mut lines =
            LineReader::open(&self.table.content, self.table.stretches[stretch], Some(self.table.end.offset))?;
        let mut parser = self.parser(&self.plan, first - before[stretch], self.length(run));
        // Where every line is a row, those before need not be looked at.
        if self.table.key.is_none() && self.table.layout.rows == RowRule::All {
            lines.pass(std::mem::take(&mut parser.skip), |_, _| Ok(()))?;
        }
        self.parse(&mut lines, parser, columns)
    }

    /// Fills columns with the parser's next rows; what is left of a block stays for the next call.
    fn parse<T: TableNumber>(
        &self,
        lines: &mut LineReader<'_>,
        mut parser: RowParser<'_>,
        columns: &mut ParticleColumns<T>,
    ) -> Result<()> {
        columns.iter_mut().for_each(Vec::clear);
        while parser.room > 0 {
            let line = lines.place().line;
            let Some(block) = lines.block()? else { return Err(self.changed()) };
            let (bytes, count) = parser.block(block, line, columns).map_err(|f| self.fault(f))?;
            lines.consume(bytes, count);
        }
        Ok(())
    }

    fn chunk<'c>(&self, columns: &'c ParticleColumns, rows: Range<usize>) -> Chunk<'c> {
        let [x, y, z, w] = columns;
        let weight = self.has_weights().then(|| &w[rows.clone()]);
        Chunk { position: [&x[rows.clone()], &y[rows.clone()], &z[rows]], weight }
    }

    /// Reads a compressed file from its beginning to the last of `runs`.
    fn stream(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let mut lines = LineReader::open(&self.table.content, self.table.start, Some(self.table.end.offset))?;
        let mut waiting = ParticleColumns::default();
        let mut next = 0;
        while next < runs.end {
            context.check()?;
            let ended = self.batch(&mut lines, &mut waiting)?;
            let whole = waiting[0].len() / RUN;
            // The last run may be shorter: it is whole once the stream has ended.
            let last = ended && next + whole as u64 + 1 == self.count().div_ceil(RUN as u64);
            let ready = whole + usize::from(last && waiting[0].len() % RUN > 0);
            let wanted = (0..ready).filter(|&i| runs.contains(&(next + i as u64)));
            parallel::try_for_each(wanted, |i| {
                let rows = i * RUN..waiting[0].len().min((i + 1) * RUN);
                if rows.len() != self.length(next + i as u64) {
                    return Err(self.changed());
                }
                sink(next + i as u64, self.chunk(&waiting, rows.clone()))?;
                context.advance(rows.len() as u64);
                Ok(())
            })?;
            next += ready as u64;
            if ended && next < runs.end {
                return Err(self.changed());
            }
            // Rows of a run that is not whole yet wait for the next blocks.
            waiting.iter_mut().filter(|c| !c.is_empty()).for_each(|c| drop(c.drain(..c.len().min(ready * RUN))));
        }
        Ok(())
    }

    /// Parses the next blocks of a stream onto the end of `out`; true at its end.
    fn batch(&self, lines: &mut LineReader<'_>, out: &mut ParticleColumns) -> Result<bool> {
        let size = (2 * parallel::threads()).min(BATCH);
        let mut blocks = Vec::with_capacity(size);
        while blocks.len() < size {
            let line = lines.place().line;
            let Some(block) = lines.block()? else { break };
            // Copied out of the window, so that blocks are parsed side by side while the stream is decoded further.
            let block = block.to_vec();
            let count = memchr::memchr_iter(b'\n', &block).count() as u64;
            lines.consume(block.len(), count);
            blocks.push((line, block));
        }
        let ended = blocks.len() < size;
        let parsed = parallel::try_map(blocks, |(line, block)| {
            let mut columns = <ParticleColumns>::default();
            self.parser(&self.plan, 0, usize::MAX).block(&block, line, &mut columns).map_err(|f| self.fault(f))?;
            Ok::<_, Error>(columns)
        })?;
        for columns in parsed {
            for (out, column) in out.iter_mut().zip(columns) {
                out.extend(column);
            }
        }
        Ok(ended)
    }
}

impl SnapshotReader for RowReader {
    fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    fn count(&self) -> u64 {
        self.table.kinds[self.kind].count
    }

    fn has_weights(&self) -> bool {
        self.plan.has_weights()
    }

    fn origin(&self) -> [f64; 3] {
        self.plan.origin()
    }

    fn read_wide(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, [&[f64]; 3]) -> Result<()>) -> Result<()> {
        let mut columns = ParticleColumns::<f64>::default();
        if self.table.content.is_seekable() {
            for run in runs {
                self.run(run, &mut columns)?;
                let [x, y, z, _] = &columns;
                sink(run, [x, y, z])?;
            }
            return Ok(());
        }
        let mut lines = LineReader::open(&self.table.content, self.table.start, Some(self.table.end.offset))?;
        // A compressed file can only be read from its beginning.
        for run in 0..runs.end {
            self.parse(&mut lines, self.parser(&self.plan, 0, self.length(run)), &mut columns)?;
            let [x, y, z, _] = &columns;
            if runs.contains(&run) {
                sink(run, [x, y, z])?;
            }
        }
        Ok(())
    }

    fn random_access(&self) -> bool {
        self.table.content.is_seekable()
    }

    fn read(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let runs = runs.start..runs.end.min(self.count().div_ceil(RUN as u64));
        if !self.table.content.is_seekable() {
            return self.stream(runs, context, sink);
        }
        let scratch = parallel::Scratch::<ParticleColumns>::default();
        parallel::try_for_each(runs, |run| {
            context.check()?;
            scratch.with(|columns| {
                self.run::<f32>(run, columns)?;
                sink(run, self.chunk(columns, 0..self.length(run)))
            })?;
            context.advance(self.length(run) as u64);
            Ok(())
        })
    }
}
