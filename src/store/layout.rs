//! The Zarr arrays of a database, and all its files except the chunks of jobs. They are
//! determined by the description alone.
use std::collections::BTreeMap;
use std::num::NonZeroU64;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value, json};
use zarrs::array::chunk_key_encoding::DefaultChunkKeyEncoding;
use zarrs::array::codec::{BytesCodec, Crc32cCodec, ShardingCodecBuilder};
use zarrs::array::{
    Array, ArrayBuilder, ArrayToBytesCodecTraits, CodecOptions, DataType, FillValue,
};
use zarrs::array::{Element, data_type};
use zarrs::filesystem::FilesystemStore;

use super::description::FILE_PER_JOB;
use super::packs::Packs;
use super::{ROOT, StoreError, Variable};
use crate::engine::Engine;
use crate::grain::SizeMeasure;
use crate::grid::{Jobs, SizeAxis};
use crate::parameter::{Axes, Parameter};
use crate::units::HALF_SPACE_CM;

pub(super) type ZarrArray = Array<FilesystemStore>;

/// Group of the arrays that have one element per job.
const JOBS: &str = "jobs";

/// The axes of a database and which curves it holds.
#[derive(Debug, Clone)]
pub(super) struct Contents {
    pub(super) axes: Axes,
    /// Values of the grain size axis if it is given by another measure than the size.
    pub(super) size_axis: Option<SizeAxis>,
    pub(super) wavelengths_nm: Vec<f64>,
    pub(super) engine: Engine,
    /// For each grain size, the number of the thinnest thicknesses without a curve; empty if
    /// all curves exist.
    pub(super) absent: Vec<usize>,
    /// Whether there are curves under diffuse light.
    pub(super) diffuse: bool,
    /// The axes of the views; empty if there are none.
    pub(super) views: Axes,
    /// Version of the layout.
    pub(super) format: u32,
}

/// The arrays that jobs write to.
#[derive(Debug)]
pub(super) struct ArrayLayout {
    pub(super) jobs: Jobs,
    pub(super) packs: Packs,
    contents: Contents,
    /// The arrays of spectra.
    quantities: Vec<QuantityArray>,
    pub(super) lost: ZarrArray,
    pub(super) committed: ZarrArray,
    storage: Arc<FilesystemStore>,
}

/// An array of spectra.
#[derive(Debug)]
struct QuantityArray {
    variable: Variable,
    array: ZarrArray,
    /// Shape of the chunk of a job.
    chunk: Vec<u64>,
}

impl ArrayLayout {
    pub(super) fn new(root: &Path, contents: Contents) -> Result<Self, StoreError> {
        let axes = &contents.axes;
        let jobs = Jobs::new(contents.engine, axes, contents.wavelengths_nm.len() as u64)?;
        let storage =
            Arc::new(FilesystemStore::new(root).map_err(StoreError::zarr("the file system"))?);
        let variables = Variable::stored(contents.diffuse, !contents.views.is_empty());
        let chunks = variables.iter().map(|v| contents.chunk(&jobs, *v));
        let packs = match contents.format {
            FILE_PER_JOB => Packs::of_one_job(&jobs),
            _ => {
                let values: u64 = chunks.map(|chunk| chunk.iter().product::<u64>()).sum();
                Packs::new(&jobs, values.saturating_mul(size_of::<f32>() as u64))
            }
        };
        let array = |variable| {
            Ok(QuantityArray {
                variable,
                array: contents.array(&storage, (&jobs, &packs), variable)?,
                chunk: contents.chunk(&jobs, variable),
            })
        };
        let quantities = variables.into_iter().map(array);
        let quantities = quantities.collect::<Result<_, StoreError>>()?;
        let per_job = |name, long_name| ArraySpec {
            name,
            long_name,
            units: "1",
            dimensions: &["job"],
        };
        let (count, pack) = (vec![jobs.count()], vec![packs.jobs()]);
        let lost = per_job(
            "jobs/lost_share",
            "largest share of rays lost at an event limit, over the curves and wavelengths of a job",
        )
        .array(&storage, count.clone(), (pack.clone(), None), data_type::float64(), f64::NAN)?;
        let committed = per_job(
            "jobs/committed",
            "first 8 bytes (little-endian) of the SHA-256 over the SHA-256 of the identity, the job and its chunk files; 0 until the job is done",
        )
        .array(&storage, count, (pack, None), data_type::uint64(), 0_u64)?;
        Ok(Self {
            jobs,
            packs,
            contents,
            quantities,
            lost,
            committed,
            storage,
        })
    }

    pub(super) fn has_diffuse(&self) -> bool {
        self.contents.diffuse
    }

    pub(super) fn axes(&self) -> &Axes {
        &self.contents.axes
    }

    /// The axes of the views; empty if there are none.
    pub(super) fn views(&self) -> &Axes {
        &self.contents.views
    }

    pub(super) fn size_axis(&self) -> Option<&SizeAxis> {
        self.contents.size_axis.as_ref()
    }

    pub(super) fn absent(&self) -> &[usize] {
        &self.contents.absent
    }

    /// Number of the thinnest thicknesses of `job` without curves.
    pub(super) fn absent_of(&self, job: u64) -> Result<usize, StoreError> {
        let size = self.jobs.nodes(job, Parameter::GrainSize)?.start;
        let thickness = self.jobs.nodes(job, Parameter::Thickness)?.start;
        let count = self.absent().get(size).copied().unwrap_or_default();
        Ok(count.saturating_sub(thickness))
    }

    /// Number of illuminations of each slab of a job: the incidence angles, then diffuse
    /// light if there is any.
    pub(super) fn lights(&self) -> usize {
        self.jobs.block_along(Parameter::Incidence) + usize::from(self.has_diffuse())
    }

    /// The array that marks absent curves, by grain size and thickness, and its values: 1 if
    /// the curve does not exist. `None` if all curves exist.
    fn status(&self) -> Result<Option<(ZarrArray, Vec<i8>)>, StoreError> {
        let absent = self.absent();
        if absent.is_empty() {
            return Ok(None);
        }
        let n = self.axes().values(Parameter::Thickness).len();
        let row = |count: &usize| {
            let count = *count;
            (0..n).map(move |h| i8::from(h < count))
        };
        let values: Vec<i8> = absent.iter().flat_map(row).collect();
        let shape = vec![absent.len() as u64, n as u64];
        let spec = ArraySpec {
            name: STATUS,
            long_name: "whether curves exist: a slab must hold ten lengths of its longest grain",
            units: "1",
            dimensions: &[Parameter::GrainSize.name(), Parameter::Thickness.name()],
        };
        let mut array = spec.array(
            &self.storage,
            shape.clone(),
            (shape, None),
            data_type::int8(),
            0_i8,
        )?;
        let attributes = array.attributes_mut();
        attributes.insert("flag_values".into(), json!([0, 1]));
        attributes.insert("flag_meanings".into(), json!("simulated grains_do_not_fit"));
        Ok(Some((array, values)))
    }

    /// Path in the database of the file that holds `pack` of a quantity.
    pub(super) fn pack_file(&self, array: &ZarrArray, quantity: Variable, pack: u64) -> String {
        array
            .chunk_key(&self.pack_index(quantity, pack))
            .to_string()
    }

    /// Index in the array of a quantity of the file that holds `pack`.
    pub(super) fn pack_index(&self, quantity: Variable, pack: u64) -> Vec<u64> {
        let own = self.axes().iter().zip(self.packs.index(pack));
        let own = own.filter(|((parameter, _), _)| quantity.has_axis(*parameter));
        // a chunk has all views and all wavelengths
        let views = self.views().iter();
        let views = views.filter(|(parameter, _)| quantity.has_axis(*parameter));
        let views = views.map(|_| 0);
        views
            .chain(own.map(|(_, index)| index))
            .chain([0])
            .collect()
    }

    /// Whether the curves of each pack are consecutive in storage order: along the axes before
    /// the first that a pack divides it has a single curve, and all curves along those after it.
    pub(super) fn has_consecutive_packs(&self) -> bool {
        let jobs = self.jobs.block().iter().zip(self.packs.block());
        let lengths = jobs.map(|(curves, jobs)| curves * jobs);
        let lengths: Vec<u64> = lengths.collect();
        let shape = self.jobs.shape();
        let divided = (0..shape.len())
            .rev()
            .find(|axis| lengths[*axis] < shape[*axis]);
        lengths
            .iter()
            .take(divided.unwrap_or_default())
            .all(|length| *length == 1)
    }

    /// Whether the files of packs are Zarr shards, which have an index of their chunks.
    pub(super) fn is_sharded(&self) -> bool {
        self.contents.format != FILE_PER_JOB
    }

    pub(super) fn wavelengths_nm(&self) -> &[f64] {
        &self.contents.wavelengths_nm
    }

    /// The arrays of spectra in the order of the chunks of a job.
    pub(super) fn quantities(&self) -> impl Iterator<Item = (Variable, &ZarrArray)> {
        let quantities = self.quantities.iter();
        quantities.map(|quantity| (quantity.variable, &quantity.array))
    }

    /// Size of the chunk of a job in each array, with its checksum, bytes.
    pub(super) fn chunk_bytes(&self) -> impl Iterator<Item = usize> {
        let values = self.quantities.iter().map(|quantity| &quantity.chunk);
        values.map(|chunk| {
            chunk.iter().product::<u64>() as usize * size_of::<f32>() + size_of::<u32>()
        })
    }

    pub(super) fn quantity(&self, quantity: Variable) -> Result<&ZarrArray, StoreError> {
        let mut arrays = self.quantities();
        arrays
            .find(|(other, _)| *other == quantity)
            .map(|(_, array)| array)
            .ok_or_else(|| StoreError::Zarr {
                name: quantity.name().into(),
                reason: "this database does not have it".into(),
            })
    }

    /// Path in the database and bytes of every file that exists from the start: metadata
    /// and coordinates. `attributes` are those of the database.
    pub(super) fn static_files(
        &self,
        attributes: Map<String, Value>,
    ) -> Result<BTreeMap<String, Vec<u8>>, StoreError> {
        let mut files = BTreeMap::new();
        let mut nodes = Map::new();
        let axes = self.views().iter().chain(self.axes().iter());
        let axes = axes.map(|(p, values)| (p.name(), values));
        for (name, values) in axes.chain([(WAVELENGTH, self.wavelengths_nm())]) {
            let array = coordinate(&self.storage, name, name, values.len() as u64)?;
            let key = format!("{name}/{}", chunk_name(&array, &[0])?);
            let infinite = |value: &f64| {
                // files store the thickness of a half space as infinity
                let is_thickness = name == Parameter::Thickness.name();
                if is_thickness && *value >= HALF_SPACE_CM {
                    f64::INFINITY
                } else {
                    *value
                }
            };
            let values: Vec<f64> = values.iter().map(infinite).collect();
            files.insert(key, encode(&array, &values)?);
            nodes.insert(name.into(), metadata(&array)?);
        }
        if let Some(given) = self.size_axis() {
            let (name, values) = (given.measure.name(), given.by_size());
            let dimension = Parameter::GrainSize.name();
            let array = coordinate(&self.storage, name, dimension, values.len() as u64)?;
            let key = format!("{name}/{}", chunk_name(&array, &[0])?);
            files.insert(key, encode(&array, &values)?);
            nodes.insert(name.into(), metadata(&array)?);
        }
        if let Some((array, values)) = self.status()? {
            let key = format!("{STATUS}/{}", chunk_name(&array, &[0, 0])?);
            files.insert(key, encode(&array, &values)?);
            nodes.insert(STATUS.into(), metadata(&array)?);
        }
        for (quantity, array) in self.quantities() {
            nodes.insert(quantity.name().into(), metadata(array)?);
        }
        let mut job_nodes = Map::new();
        for (name, array) in [("lost_share", &self.lost), ("committed", &self.committed)] {
            job_nodes.insert(name.into(), metadata(array)?);
        }
        let job_attributes = json!({
            "description": "one element per job of the program that made this database",
        });
        // xarray expects the metadata of all nodes inline in the group that it opens.
        let job_group = group(job_attributes.clone(), job_nodes.clone());
        nodes.insert(JOBS.into(), group(job_attributes, Map::new()));
        for (name, node) in job_nodes {
            nodes.insert(format!("{JOBS}/{name}"), node);
        }
        for (name, node) in &nodes {
            let node = if name == JOBS { &job_group } else { node };
            files.insert(format!("{name}/zarr.json"), pretty(node)?);
        }
        let root = group(Value::Object(attributes), nodes);
        files.insert(ROOT.into(), pretty(&root)?);
        Ok(files)
    }
}

impl Contents {
    /// Name and length of the axes of the array of `variable`, and the number of its values in a
    /// job and in a pack: views first, wavelengths last.
    fn dimensions(
        &self,
        jobs: &Jobs,
        variable: Variable,
        packs: Option<&Packs>,
    ) -> Vec<(&'static str, u64, u64)> {
        let views = self.views.iter().map(|(parameter, values)| {
            let length = values.len() as u64;
            (parameter, length, length)
        });
        let axes = self.axes.iter().zip(jobs.shape()).zip(jobs.block());
        let axes = axes
            .enumerate()
            .map(|(axis, (((parameter, _), length), block))| {
                let jobs = packs.map_or(1, |packs| packs.block()[axis]);
                (parameter, *length, block * jobs)
            });
        let axes = views.chain(axes);
        let axes = axes.filter(|(parameter, ..)| variable.has_axis(*parameter));
        let axes = axes.map(|(parameter, length, block)| (parameter.name(), length, block));
        let wavelengths = (WAVELENGTH, jobs.wavelengths(), jobs.wavelengths());
        axes.chain([wavelengths]).collect()
    }

    /// Shape of the chunk of a job in the array of `variable`.
    fn chunk(&self, jobs: &Jobs, variable: Variable) -> Vec<u64> {
        let dimensions = self.dimensions(jobs, variable, None).into_iter();
        dimensions.map(|(.., block)| block).collect()
    }

    /// The array of `variable`.
    fn array(
        &self,
        storage: &Arc<FilesystemStore>,
        (jobs, packs): (&Jobs, &Packs),
        variable: Variable,
    ) -> Result<ZarrArray, StoreError> {
        let dimensions = self.dimensions(jobs, variable, Some(packs));
        let names: Vec<_> = dimensions.iter().map(|(name, ..)| *name).collect();
        let shape = dimensions.iter().map(|(_, length, _)| *length).collect();
        let pack = dimensions.iter().map(|(.., block)| *block).collect();
        let spec = ArraySpec {
            name: variable.name(),
            long_name: variable.long_name(),
            units: "1",
            dimensions: &names,
        };
        let chunk = (self.format != FILE_PER_JOB).then(|| self.chunk(jobs, variable));
        spec.array(
            storage,
            shape,
            (pack, chunk),
            data_type::float32(),
            f32::NAN,
        )
    }
}

pub(crate) use crate::lookup::format::WAVELENGTH;

/// Name of the array that marks absent curves.
const STATUS: &str = "curve_status";

/// Name, description and dimensions of an array.
struct ArraySpec<'a> {
    name: &'a str,
    long_name: &'a str,
    units: &'a str,
    dimensions: &'a [&'a str],
}

impl ArraySpec<'_> {
    /// The array with one file per `file` of its values, which is a shard of chunks if their shape
    /// is given.
    fn array(
        &self,
        storage: &Arc<FilesystemStore>,
        shape: Vec<u64>,
        (file, chunk): (Vec<u64>, Option<Vec<u64>>),
        data_type: DataType,
        fill_value: impl Into<FillValue>,
    ) -> Result<ZarrArray, StoreError> {
        let attributes = json!({ "long_name": self.long_name, "units": self.units });
        let sharding = match chunk {
            None => None,
            Some(chunk) => {
                let lengths: Option<Vec<NonZeroU64>> =
                    chunk.into_iter().map(NonZeroU64::new).collect();
                let lengths = lengths.ok_or_else(|| StoreError::Zarr {
                    name: self.name.into(),
                    reason: "a chunk is empty".into(),
                })?;
                let mut sharding = ShardingCodecBuilder::new(lengths, &data_type);
                // The same bytes on every processor.
                sharding
                    .array_to_bytes_codec(Arc::new(BytesCodec::little()))
                    .index_array_to_bytes_codec(Arc::new(BytesCodec::little()))
                    .bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())]);
                Some(sharding.build_arc())
            }
        };
        let mut builder = ArrayBuilder::new(shape, file, data_type, fill_value.into());
        builder
            // All files of an array are in one folder: they are small, and a folder per
            // index would need more space than the data.
            .chunk_key_encoding(DefaultChunkKeyEncoding::new_dot())
            .dimension_names(Some(self.dimensions.iter().copied()));
        match sharding {
            Some(sharding) => builder.array_to_bytes_codec(sharding),
            None => builder.bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())]),
        };
        if let Value::Object(attributes) = attributes {
            builder.attributes(attributes);
        }
        builder
            .build(storage.clone(), &format!("/{}", self.name))
            .map_err(StoreError::zarr(self.name))
    }
}

/// Description and unit of a coordinate.
pub(crate) fn coordinate_about(name: &str) -> (&'static str, &'static str) {
    if let Some(parameter) = Parameter::named(name) {
        return (parameter.record().long_name, parameter.unit());
    }
    match SizeMeasure::ALL.into_iter().find(|m| m.name() == name) {
        Some(measure) => measure.about(),
        None => ("wavelength in vacuum", "nm"),
    }
}

fn coordinate(
    storage: &Arc<FilesystemStore>,
    name: &str,
    dimension: &str,
    length: u64,
) -> Result<ZarrArray, StoreError> {
    let (long_name, units) = coordinate_about(name);
    let spec = ArraySpec {
        name,
        long_name,
        units,
        dimensions: &[dimension],
    };
    spec.array(
        storage,
        vec![length],
        (vec![length], None),
        data_type::float64(),
        f64::NAN,
    )
}

/// The bytes of the file of a chunk of `array` with these `values`.
pub(super) fn encode<T: Element>(array: &ZarrArray, values: &[T]) -> Result<Vec<u8>, StoreError> {
    let name = array.path().as_str();
    let chunk = vec![0; array.dimensionality()];
    let shape = array.chunk_shape(&chunk).map_err(StoreError::zarr(name))?;
    let bytes = T::to_array_bytes(array.data_type(), values).map_err(StoreError::zarr(name))?;
    array
        .codecs()
        .encode(
            bytes,
            &shape,
            array.data_type(),
            array.fill_value(),
            &CodecOptions::default(),
        )
        .map(std::borrow::Cow::into_owned)
        .map_err(StoreError::zarr(name))
}

/// Name of the file of a chunk, in the folder of its array.
fn chunk_name(array: &ZarrArray, chunk: &[u64]) -> Result<String, StoreError> {
    let key = array.chunk_key(chunk);
    let name = key.as_str().rsplit('/').next().unwrap_or_default();
    Ok(name.into())
}

fn metadata(array: &ZarrArray) -> Result<Value, StoreError> {
    serde_json::to_value(array.metadata()).map_err(StoreError::zarr(array.path().as_str()))
}

fn group(attributes: Value, nodes: Map<String, Value>) -> Value {
    json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attributes,
        "consolidated_metadata": {
            "kind": "inline",
            "must_understand": false,
            "metadata": nodes,
        },
    })
}

fn pretty(value: &Value) -> Result<Vec<u8>, StoreError> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(StoreError::zarr("metadata"))?;
    bytes.push(b'\n');
    Ok(bytes)
}
