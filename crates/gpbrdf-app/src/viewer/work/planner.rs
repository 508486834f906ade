//! The thread that plans which directions to measure next.

use std::sync::Arc;

use gpbrdf_core::plan::{Belief, Candidates, Cells, Device, Goal, Plan, plan};
use gpbrdf_core::{FitOptions, Model, SampleSet};

use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;
use crate::job::PriorName;
use crate::message::said_once;
use crate::viewer::state::document::{Document, DocumentId};

/// What a plan was made from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlanKey {
    pub(crate) document: DocumentId,
    /// The version of the fitted model; `None` where the plan is that of the first measurements.
    pub(crate) version: Option<u64>,
    pub(crate) prior: PriorName,
    pub(crate) device: Device,
    pub(crate) count: usize,
}

/// A plan to make.
#[derive(Clone, Debug)]
pub(crate) struct PlanRequest {
    pub(crate) key: PlanKey,
    /// The model of what was measured, and that; nothing before the first measurements.
    known: Option<(Arc<Model>, Arc<SampleSet>)>,
}

/// A plan, or why there is none.
#[derive(Clone, Debug)]
pub(crate) struct Planned {
    pub(crate) key: PlanKey,
    pub(crate) plan: Result<Plan, String>,
}

impl PlanRequest {
    /// The request for an open material: what to measure next where it is a list of measurements, what to measure first
    /// otherwise. `None` until measurements are fitted.
    pub(crate) fn of(document: &Document, device: Device, count: usize) -> Option<Self> {
        let known = if document.is_scattered() {
            let fitted = document.fitted.as_ref()?;
            Some((fitted.version, Arc::clone(&fitted.model), Arc::clone(&fitted.samples)))
        } else {
            None
        };
        let key = PlanKey {
            document: document.id,
            version: known.as_ref().map(|(version, ..)| *version),
            prior: document.spec.prior.clone(),
            device,
            count,
        };
        Some(Self { key, known: known.map(|(_, model, samples)| (model, samples)) })
    }
}

/// Starts the thread.
pub(crate) fn spawn(outbox: Outbox<Planned>) -> std::io::Result<Sender<PlanRequest>> {
    Mailbox::spawn("planner", move |request: PlanRequest, _stale| {
        let plan = planned(&request).map_err(|error| said_once(&error));
        outbox.send(Planned { key: request.key, plan });
    })
}

fn planned(request: &PlanRequest) -> anyhow::Result<Plan> {
    let PlanKey { device, count, prior, .. } = &request.key;
    let candidates = Candidates::of(device)?;
    let cells = Cells::usual(None, Cells::COUNT)?;
    let options = FitOptions { prior: prior.open()?, ..FitOptions::default() };
    let (belief, measured) = match &request.known {
        None => (Belief::before(options.prior.prior().as_ref()), &[][..]),
        Some((model, samples)) => (Belief::of_model(model, samples, &options)?, &samples.angles[..]),
    };
    Ok(plan(&belief, measured, &candidates, &cells, Goal::Count((*count).min(candidates.len())))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpbrdf_core::Source;

    #[test]
    fn the_first_measurements_of_any_material_are_planned() {
        let document = Document::new(DocumentId(0), Source::built_in("lambert").unwrap());
        let request = PlanRequest::of(&document, Device::default(), 12).unwrap();
        let plan = planned(&request).unwrap();
        assert_eq!(plan.geometries.len(), 12);
        assert!(plan.errors.windows(2).all(|pair| pair[1] <= pair[0]), "{:?}", plan.errors);
    }

    #[test]
    fn limits_that_leave_nothing_say_so() {
        let document = Document::new(DocumentId(0), Source::built_in("lambert").unwrap());
        let device = Device { step: 0.1, ..Device::default() };
        let request = PlanRequest::of(&document, device, 12).unwrap();
        assert!(planned(&request).unwrap_err().to_string().contains("step"));
    }
}
