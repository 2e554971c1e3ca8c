//! Requests whose absorbers are so many, in so many different mixtures, that walks can follow
//! them at a few wavelengths only ([`Tracers`]): the list of wavelengths is divided.
//!
//! Every part walks the same random streams. A part keeps no units of a checkpoint and no
//! walks, because these would be taken for those of another part: its results are one unit.
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Cache, Control, EngineError, Request};
use crate::transport::TRACERS;
#[cfg(doc)]
use crate::transport::Tracers;

/// The parts of `request`; `None` if it need not be divided.
pub(super) fn parts<'a>(request: &Request<'a>) -> Option<Vec<Request<'a>>> {
    let part = |wavelengths_nm| Request {
        wavelengths_nm,
        ..request.clone()
    };
    let parts = || request.wavelengths_nm.chunks(TRACERS).map(part).collect();
    (request.tracers().len() > TRACERS).then(parts)
}

/// The results of `run` for each part of `request`; `None` if it need not be divided. `kind`
/// tells apart the results of one request that are computed in different ways.
pub(super) fn run<T: Serialize + DeserializeOwned>(
    kind: &str,
    request: &Request,
    control: &Control,
    run: impl Fn(&Request, &Control) -> Result<T, EngineError>,
) -> Result<Option<Vec<T>>, EngineError> {
    let run_part = |part: Request| {
        let units = &control.cache.units;
        let name = format!(
            "{kind} {} {:?} {:?} {:?}",
            part.cell, part.illuminations, part.thicknesses_m, part.wavelengths_nm
        );
        if let Some(result) = units.take(&name) {
            return Ok(result);
        }
        let cache = Cache {
            tables: control.cache.tables.clone(),
            ..Cache::default()
        };
        let control = Control {
            cache: &cache,
            ..*control
        };
        let result = run(&part, &control)?;
        units.add(&name, &result)?;
        Ok(result)
    };
    let results = parts(request).map(|parts| parts.into_iter().map(run_part).collect());
    results.transpose()
}
