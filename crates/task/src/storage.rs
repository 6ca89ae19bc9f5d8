//! Channels as Parquet: one flat column of doubles a channel, read back checked. Any data-frame
//! library reads them.

use crate::{Channels, Error, Result};
use parquet::basic::{Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::data_type::DoubleType;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use trocar_scene::{BuiltinTask, Gates, InstrumentKind, Program, Side, TaskContext, TaskName};
use xxhash_rust::xxh3::Xxh3;

/// The key of [`ChannelsInfo`] in the file's metadata.
const KEY: &str = "trocar";
/// The first bytes of every Parquet file.
const PARQUET: &[u8; 4] = b"PAR1";
const FORMAT: &str = "trocar-channels";
const VERSION: u32 = 4;

/// The name of a column of this version in files of an earlier `version`. `None` for one that they
/// do not have, which is read as zeros.
fn name_in(version: u32, name: &str) -> Option<String> {
    let warnings = ["punctures", "pierced", "overstretched", "folded"];
    if version < 4 && (name.ends_with("_pierces") || warnings.contains(&name)) {
        return None;
    }
    if version < 3 && name.ends_with("_solid_n") {
        return None;
    }
    if version < 2 && (name.ends_with("_guarded") || name == "activation_step_mm") {
        return None;
    }
    Some(name.to_owned())
}

/// Most rows of a file: nine hours.
const MAX_ROWS: usize = 1_000_000;
/// Largest file (bytes).
const MAX_BYTES: u64 = 1 << 31;

/// The description in a file of channels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelsInfo {
    /// Name of the scene.
    pub scene: String,
    /// Its task.
    pub task: TaskName,
    /// Its gates.
    pub gates: Gates,
    /// The task's checked expressions; `None` in files that were written before tasks were files,
    /// which are of built-in tasks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub context: Option<TaskContext>,
    /// RCM deviation that episodes are scored against (mm).
    pub rcm_threshold_mm: f64,
    /// RCM deviation beyond which an episode is lost (mm); None in files that were written before
    /// it was.
    #[serde(default)]
    pub rcm_abort_mm: Option<f64>,
    /// The arms that the scene has, left first.
    pub arms: Vec<String>,
    /// Name of the policy.
    pub policy: String,
    /// The episode's seed.
    pub seed: u64,
}

/// The content of the file.
#[derive(Serialize, Deserialize)]
struct Stored {
    format: String,
    version: u32,
    program: String,
    rows: usize,
    hash: String,
    #[serde(flatten)]
    info: ChannelsInfo,
}

impl ChannelsInfo {
    /// The task, ready to be judged.
    ///
    /// # Errors
    /// A task that is none.
    pub fn program(&self) -> Result<Program> {
        let builtin = || -> Result<TaskContext> {
            let task = BuiltinTask::named(self.task);
            let task = task.ok_or_else(|| Error::Option(format!("no built-in task '{}'", self.task.name())))?;
            let arms = vec![(Side::Left, InstrumentKind::Grasper), (Side::Right, InstrumentKind::Cutter)];
            Ok(TaskContext { definition: task.definition()?, arms, ..TaskContext::default() })
        };
        let context = match &self.context {
            Some(context) => context.clone(),
            None => builtin()?,
        };
        context.program(&self.gates).map_err(|m| Error::Option(format!("task.{}{}", m.field, m.reason)))
    }
}

/// An additional column with one number per row: data about an episode that is not part of it.
/// Readers of channels skip it.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name, which no channel has.
    pub name: String,
    /// Its numbers.
    pub values: Vec<f64>,
}

/// Writes rows to `path`, and the columns `beside` them, whole or not at all.
///
/// # Errors
/// When the file cannot be written; a column with the name of another or with too few numbers.
pub fn write_channels(path: &Path, info: &ChannelsInfo, rows: &[Channels], beside: &[Column]) -> Result<()> {
    let bytes = encode(info, rows, beside).map_err(|reason| Error::Invalid { path: path.to_owned(), reason })?;
    write_whole(path, &bytes)
}

/// Writes a file beside its place and moves it there.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    std::fs::write(&beside, bytes).map_err(io)?;
    std::fs::rename(&beside, path).map_err(io)
}

fn encode(info: &ChannelsInfo, rows: &[Channels], beside: &[Column]) -> std::result::Result<Vec<u8>, String> {
    let failed = |e: parquet::errors::ParquetError| format!("cannot be written: {e}");
    let measures = info.program().map_err(|e| e.to_string())?.measures;
    let mut names = Channels::names();
    names.extend(measures.iter().map(ToString::to_string));
    for column in beside {
        let (name, count) = (&column.name, column.values.len());
        if names.contains(name) || count != rows.len() {
            return Err(format!("column '{name}' with {count} numbers does not fit beside {} rows", rows.len()));
        }
        names.push(name.clone());
    }
    let field = |name: &String| {
        let made = Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED).build();
        made.map(Arc::new)
    };
    let fields = names.iter().map(field).collect::<std::result::Result<_, _>>().map_err(failed)?;
    let schema = Type::group_type_builder("channels").with_fields(fields).build().map_err(failed)?;
    let row = |c: &Channels| {
        let mut row = c.to_row();
        row.extend(&c.measures[..measures.len()]);
        row
    };
    let table: Vec<Vec<f64>> = rows.iter().map(row).collect();
    let stored = Stored {
        format: FORMAT.to_owned(),
        version: VERSION,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        rows: rows.len(),
        hash: format!("{:016x}", hash(&table)),
        info: info.clone(),
    };
    let text = serde_json::to_string(&stored).map_err(|e| format!("cannot be written: {e}"))?;
    let properties = WriterProperties::builder()
        .set_created_by(format!("trocar {}", env!("CARGO_PKG_VERSION")))
        .set_key_value_metadata(Some(vec![KeyValue::new(KEY.to_owned(), text)]))
        .build();
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties)).map_err(failed)?;
    let mut group = writer.next_row_group().map_err(failed)?;
    let mut k = 0_usize;
    while let Some(mut column) = group.next_column().map_err(failed)? {
        let values: Vec<f64> = match k.checked_sub(names.len() - beside.len()) {
            Some(k) => beside[k].values.clone(),
            None => table.iter().map(|row| row[k]).collect(),
        };
        column.typed::<DoubleType>().write_batch(&values, None, None).map_err(failed)?;
        column.close().map_err(failed)?;
        k += 1;
    }
    group.close().map_err(failed)?;
    writer.into_inner().map_err(failed)
}

fn hash(rows: &[Vec<f64>]) -> u64 {
    let mut hash = Xxh3::new();
    for row in rows {
        row.iter().for_each(|x| hash.update(&x.to_bits().to_le_bytes()));
    }
    hash.digest()
}

/// Reads what [`write_channels`] wrote.
///
/// # Errors
/// Names the file and what is wrong: not Parquet, not ours, a column that is missing, values that
/// are not those that were written.
pub fn read_channels(path: &Path) -> Result<(ChannelsInfo, Vec<Channels>)> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let invalid = |reason: String| Error::Invalid { path: path.to_owned(), reason };
    let file = std::fs::File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    if length > MAX_BYTES {
        return Err(invalid(format!("has {length} bytes; at most {MAX_BYTES} are read")));
    }
    let mut start = [0; PARQUET.len()];
    if (&file).read_exact(&mut start).is_err() || start != *PARQUET {
        return Err(invalid("is no Parquet file; name the folder of an episode, or its channels.parquet".to_owned()));
    }
    // The decoder is a dependency: a file at which it panics is a bad file, too.
    catch_unwind(AssertUnwindSafe(|| decode(file)))
        .unwrap_or_else(|_| Err("is damaged: its pages cannot be decoded".to_owned()))
        .map_err(invalid)
}

fn decode(file: std::fs::File) -> std::result::Result<(ChannelsInfo, Vec<Channels>), String> {
    let failed = |e: parquet::errors::ParquetError| format!("is not a readable Parquet file: {e}");
    let reader = SerializedFileReader::new(file).map_err(failed)?;
    let metadata = reader.metadata();
    let said = metadata.file_metadata().key_value_metadata().and_then(|all| all.iter().find(|kv| kv.key == KEY));
    let text = said.and_then(|kv| kv.value.as_deref());
    let text = text.ok_or(format!("has no '{KEY}' metadata; channels are written by trocar episode"))?;
    let stored: Stored = serde_json::from_str(text).map_err(|e| format!("its '{KEY}' metadata is damaged: {e}"))?;
    if stored.format != FORMAT || !(1..=VERSION).contains(&stored.version) {
        let (format, version) = (&stored.format, stored.version);
        return Err(format!("is {format} version {version}; {FORMAT} versions 1 to {VERSION} are read"));
    }
    let count = usize::try_from(metadata.file_metadata().num_rows()).unwrap_or(usize::MAX);
    if count != stored.rows || count > MAX_ROWS {
        return Err(format!("has {count} rows where {} were written (at most {MAX_ROWS})", stored.rows));
    }
    let columns = metadata.file_metadata().schema_descr().columns();
    let mut table = vec![Vec::with_capacity(Channels::COUNT); count];
    let mut sum = vec![Vec::new(); count];
    let measures = stored.info.program().map_err(|e| e.to_string())?.measures;
    for name in Channels::names().into_iter().chain(measures.iter().map(ToString::to_string)) {
        let name = if stored.version < VERSION { name_in(stored.version, &name) } else { Some(name) };
        let Some(name) = name else {
            table.iter_mut().for_each(|row| row.push(0.0));
            continue;
        };
        let column = columns.iter().position(|c| c.name() == name);
        let column = column.ok_or_else(|| format!("has no column '{name}'"))?;
        let mut values = Vec::new();
        for g in 0..reader.num_row_groups() {
            let group = reader.get_row_group(g).map_err(failed)?;
            let ColumnReader::DoubleColumnReader(mut reader) = group.get_column_reader(column).map_err(failed)? else {
                return Err(format!("its column '{name}' is not of doubles"));
            };
            while values.len() < count {
                let (_, read, _) =
                    reader.read_records(count - values.len(), None, None, &mut values).map_err(failed)?;
                if read == 0 {
                    break;
                }
            }
        }
        if values.len() != count {
            return Err(format!("its column '{name}' has {} values; there are {count} rows", values.len()));
        }
        sum.iter_mut().zip(&values).for_each(|(row, value)| row.push(*value));
        table.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
    }
    let made = |row: &Vec<f64>| {
        let (channels, measured) = row.split_at_checked(Channels::COUNT)?;
        let mut made = Channels::from_row(channels)?;
        made.measures.get_mut(..measured.len())?.copy_from_slice(measured);
        Some(made)
    };
    let rows: Option<Vec<Channels>> = table.iter().map(made).collect();
    let rows = rows.ok_or("has rows that are no channels")?;
    let found = format!("{:016x}", hash(&sum));
    if found != stored.hash {
        return Err(format!("its values are not those that were written: their hash is {found}, not {}", stored.hash));
    }
    Ok((stored.info, rows))
}
