//! `motion.parquet`: the rows and columns of `motion.csv` with their types, for data frames.
//!
//! An empty field of the table is null. Numbers are 64 bit, words are strings; nothing is compressed.

use std::path::Path;
use std::sync::Arc;

use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use crate::tables::motion_table::{EstimatedMotion, MotionRow, covariance_columns, upper_triangle};
use crate::{IoError, write};

/// φ's components.
const PHI: [&str; 6] = ["tx", "ty", "tz", "wx", "wy", "wz"];
/// Value, low and high end of the time to impact.
const IMPACT: [&str; 3] = ["impact_s", "impact_lo_s", "impact_hi_s"];

/// Write the table; see [`encode`].
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, rows: &[MotionRow]) -> std::result::Result<(), IoError> {
    let bytes = encode(rows).map_err(|error| {
        IoError::new(path, format_args!("cannot be made: {error}"), "use motion.csv, which holds the same")
    })?;
    write::bytes(path, &bytes)
}

/// The table as the bytes of a Parquet file, in one group of rows.
///
/// `frame`, `time_s` and `status` are always there. As in `motion.csv` a component of φ that is not observed has no
/// value and an infinite variance; a row without an answer has neither φ nor covariance.
///
/// # Errors
/// What the Parquet library says; none is known.
pub fn encode(rows: &[MotionRow]) -> Result<Vec<u8>> {
    let schema = Arc::new(parse_message_type(&schema())?);
    let about =
        WriterProperties::builder().set_created_by(concat!("egomotion ", env!("CARGO_PKG_VERSION")).into());
    let mut file = SerializedFileWriter::new(Vec::new(), schema, Arc::new(about.build()))?;
    let group = file.next_row_group()?;
    Columns { rows, group }.all()?;
    file.into_inner()
}

/// The columns of `motion.csv`, in their order.
fn schema() -> String {
    let double = |name: String| format!("optional double {name};");
    let covariance = |name: &str| covariance_columns(name).map(double).collect::<String>();
    let doubles = |names: &[&str]| names.iter().map(|name| double((*name).to_owned())).collect::<String>();
    format!(
        "message motion {{ required int64 frame; required double time_s; {} {} {} \
         optional int64 rows; optional int64 inliers; optional binary observed (string); {} \
         required binary status (string); {} }}",
        double("dt_s".into()),
        doubles(&PHI),
        covariance("cov"),
        doubles(&IMPACT),
        covariance("own"),
    )
}

/// The columns on their way into a file, one after the other.
struct Columns<'a, 'f> {
    rows: &'a [MotionRow],
    group: SerializedRowGroupWriter<'f, Vec<u8>>,
}

impl Columns<'_, '_> {
    fn all(mut self) -> Result<()> {
        self.required::<Int64Type>(|row| row.frame as i64)?;
        self.required::<DoubleType>(|row| row.time_s)?;
        self.optional::<DoubleType>(|row| row.dt_s)?;
        for i in 0..PHI.len() {
            self.of_motion::<DoubleType>(|motion| motion.observed[i].then(|| motion.phi.mean[i]))?;
        }
        for (i, j) in upper_triangle() {
            self.of_motion::<DoubleType>(|motion| Some(motion.phi.cov[(i, j)]))?;
        }
        self.of_motion::<Int64Type>(|motion| Some(motion.rows as i64))?;
        self.of_motion::<Int64Type>(|motion| Some(motion.inliers as i64))?;
        self.of_motion::<ByteArrayType>(|motion| Some(motion.observed_word().as_str().into()))?;
        for k in 0..IMPACT.len() {
            self.optional::<DoubleType>(|row| row.impact_s.map(|seconds| seconds[k]))?;
        }
        self.required::<ByteArrayType>(|row| ByteArray::from(row.status.as_str()))?;
        for (i, j) in upper_triangle() {
            self.of_motion::<DoubleType>(|motion| Some(motion.own?[(i, j)]))?;
        }
        self.group.close().map(|_| ())
    }

    fn of_motion<T: DataType>(&mut self, value: impl Fn(&EstimatedMotion) -> Option<T::T>) -> Result<()> {
        self.optional::<T>(|row| value(row.motion.as_ref()?))
    }

    fn required<T: DataType>(&mut self, value: impl Fn(&MotionRow) -> T::T) -> Result<()> {
        let values: Vec<T::T> = self.rows.iter().map(value).collect();
        self.column::<T>(&values, None)
    }

    fn optional<T: DataType>(&mut self, value: impl Fn(&MotionRow) -> Option<T::T>) -> Result<()> {
        let values: Vec<Option<T::T>> = self.rows.iter().map(value).collect();
        // One level a row: whether it has a value.
        let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
        self.column::<T>(&values.into_iter().flatten().collect::<Vec<_>>(), Some(&levels))
    }

    fn column<T: DataType>(&mut self, values: &[T::T], levels: Option<&[i16]>) -> Result<()> {
        let next = self.group.next_column()?;
        let mut column = next.ok_or_else(|| ParquetError::General("one column too many".into()))?;
        column.typed::<T>().write_batch(values, levels, None)?;
        column.close()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use egomotion::geometry::Gaussian;
    use nalgebra::{Matrix6, Vector6};
    use parquet::basic::Type;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    use super::*;
    use crate::tables::motion_table;

    fn rows() -> Vec<MotionRow> {
        let mut cov = Matrix6::from_fn(|i, j| if i == j { 1.0 + i as f64 } else { 0.1 / (1 + i + j) as f64 });
        cov[(2, 2)] = f64::INFINITY;
        let phi = Gaussian { mean: Vector6::new(0.1, -1.0 / 3.0, 0.0, 2e-3, -0.0, -5.5), cov };
        let observed = [true, true, false, true, true, true];
        let motion = Some(EstimatedMotion { phi, own: Some(cov * 0.25), observed, rows: 900, inliers: 800 });
        let row = |frame, motion, impact_s, status: &str| MotionRow {
            frame,
            time_s: 1e9 + 0.1 * frame as f64,
            dt_s: (frame > 3).then_some(0.1),
            motion,
            impact_s,
            status: status.into(),
        };
        vec![
            row(3, None, None, "bad_image"),
            row(4, motion, Some([1.5, 1.2, f64::INFINITY]), "partial"),
            row(5, None, None, "few_rows"),
        ]
    }

    /// A value as `motion.csv` writes it.
    fn field(value: &Field) -> String {
        match value {
            Field::Null => String::new(),
            Field::Long(v) => v.to_string(),
            Field::Double(v) => format!("{v:?}"),
            Field::Str(v) => v.clone(),
            other => panic!("{other:?} is no type of ours"),
        }
    }

    #[test]
    fn every_value_is_that_of_the_table_under_the_same_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("motion.parquet");
        for rows in [rows(), Vec::new()] {
            write(&path, &rows).unwrap();
            let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
            let columns = reader.metadata().file_metadata().schema_descr().columns().to_vec();
            let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
            let mut text = names.join(",") + "\n";
            for row in reader.get_row_iter(None).unwrap() {
                let row = row.unwrap();
                text += &(row.get_column_iter().map(|(_, value)| field(value)).collect::<Vec<_>>().join(",")
                    + "\n");
            }
            assert_eq!(text, motion_table::text(&rows));
            let types: Vec<Type> = columns.iter().map(|column| column.physical_type()).collect();
            assert_eq!((types[0], types[36]), (Type::INT64, Type::BYTE_ARRAY));
            assert!(types[1..30].iter().all(|of| *of == Type::DOUBLE));
            assert!(columns[36].self_type().is_primitive() && !columns[36].self_type().is_optional());
        }
    }

    #[test]
    fn a_place_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none").join("motion.parquet");
        assert!(write(&path, &rows()).unwrap_err().to_string().contains("motion.parquet: cannot write"));
    }
}
