//! The messages that show a measurement.

use crate::hub::Numbered;
use crate::measurement::Measurement;
use crate::wire::{Told, floats, message};
use phasmid_core::error::Result;
use std::sync::Arc;

/// Maximum number of layers that a viewer can ask for at a time.
const MAX_LAYERS: usize = 8;
/// Maximum number of points that are shown. Larger clouds are thinned out.
const MAX_POINTS: usize = 640 * 480;

/// Views that a viewer wants of each measurement.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) layers: Vec<String>,
    /// Name of the layer whose values the points of the cloud have; `None` if the cloud is not
    /// wanted.
    pub(crate) cloud: Option<String>,
}

impl Wanted {
    pub(crate) fn is_nothing(&self) -> bool {
        self.layers.is_empty() && self.cloud.is_none()
    }
}

/// Computes the messages that show a measurement. If a view cannot be computed, a message says why.
pub(crate) fn messages(
    source: usize,
    measurement: &Numbered<Arc<dyn Measurement>>,
    wanted: &Wanted,
) -> Vec<Vec<u8>> {
    let Numbered { number, value } = measurement;
    let number = *number;
    let mut all = Vec::new();
    match show(source, number, &**value, wanted, &mut all) {
        Ok(()) => all.push(message(&Told::Complete { source, number }, &[])),
        Err(why) => all.extend(failed(source, number, why.to_string())),
    }
    all
}

/// Returns the messages for a measurement that cannot be shown completely: the reason, and the end
/// of the measurement.
pub(crate) fn failed(source: usize, number: u64, why: String) -> Vec<Vec<u8>> {
    let told = Told::Unmeasured {
        source,
        number,
        why,
    };
    let ends = [told, Told::Complete { source, number }];
    ends.iter().map(|told| message(told, &[])).collect()
}

fn show(
    source: usize,
    number: u64,
    measurement: &dyn Measurement,
    wanted: &Wanted,
    all: &mut Vec<Vec<u8>>,
) -> Result<()> {
    let about = measurement.about()?;
    let known = |name: &str| about.layers.iter().any(|layer| layer.name == name);
    let names: Vec<_> = { wanted.layers.iter() }
        .filter(|name| known(name))
        .take(MAX_LAYERS)
        .collect();
    // The layer may have been chosen for another scanner. If this measurement lacks it, show the
    // depth.
    let cloud = { wanted.cloud.as_ref() }.filter(|_| about.cloud);
    let cloud = cloud.map(|name| if known(name) { name } else { "depth" });
    let told = Told::Measurement {
        source,
        number,
        about: about.clone(),
    };
    all.push(message(&told, &[]));
    for name in names {
        let values = measurement.layer(name)?;
        let told = Told::Layer {
            source,
            number,
            name,
        };
        all.push(message(&told, &floats(&values)));
    }
    if let Some(name) = cloud {
        let points = measurement.cloud(name, MAX_POINTS)?;
        let told = Told::Cloud {
            source,
            number,
            name,
            every: points.every,
        };
        all.push(message(&told, &floats(points.points.as_flattened())));
    }
    Ok(())
}
