//! An open material: its source, its truth, the model that is wanted and what has been fitted.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui::Color32;
use gpbrdf_core::judge::{CellMetrics, ImageMetrics, LeftOut};
use gpbrdf_core::plan::Plan;
use gpbrdf_core::{
    Brdf, BrdfTable, Content, FitReport, HalfDiff, Hyper, Model, Progress, Rgb, SampleSet, Source,
};

use crate::job::{ModelSpec, Stage, remaining};
use crate::viewer::work::planner::Planned;

/// Names a document for as long as the program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct DocumentId(pub(crate) u64);

/// What the fitter has found for one request. Later stages fill in what is `None`.
#[derive(Clone, Debug)]
pub(crate) struct Fitted {
    /// A number that no other result has.
    pub(crate) version: u64,
    pub(crate) model: Arc<Model>,
    pub(crate) samples: Arc<SampleSet>,
    /// Unknown for a model from a file.
    pub(crate) log_marginal_likelihood: Option<f64>,
    /// How the search went; `None` for hyper-parameters that were set by hand.
    pub(crate) report: Option<FitReport>,
    /// Every sample as it is predicted from all others, where the solver leaves samples out.
    pub(crate) left_out: Option<LeftOut>,
    pub(crate) mean: Arc<BrdfTable>,
    /// Standard deviation of the latent target of each channel in every cell.
    pub(crate) sigma: Option<Arc<BrdfTable>>,
    pub(crate) cells: Option<CellMetrics>,
    pub(crate) images: Option<ImageMetrics>,
    /// Seconds to sample, fit and bake the mean.
    pub(crate) seconds: [f64; 3],
}

/// The state of the work on a document.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Work {
    /// There is nothing to do.
    Idle,
    /// A request has been made and the fitter has not begun it.
    Waiting,
    /// The fitter is in a stage that began at `begun`, of a request that began at `since`, and has come so far in it.
    Running { stage: Stage, since: Instant, begun: Instant, progress: Progress },
    /// The user has cancelled it.
    Cancelled,
    /// It ended with an error.
    Failed(String),
}

impl Work {
    /// What people read: the stage, the share that is done and the time that is left, once both are known.
    pub(crate) fn text(&self) -> Option<String> {
        match self {
            Self::Idle => None,
            Self::Waiting => Some("Waiting".to_owned()),
            Self::Cancelled => Some("Cancelled".to_owned()),
            Self::Failed(message) => Some(format!("Failed: {message}")),
            Self::Running { stage, since, begun, progress } => {
                let seconds = since.elapsed().as_secs_f64();
                let mut text = stage.label().to_owned();
                let left = progress.share.and_then(|share| remaining(begun.elapsed(), share));
                match progress.share {
                    Some(share) => text.push_str(&format!(", {:.0} %", 100.0 * share)),
                    None if progress.evaluations > 0 => {
                        text.push_str(&format!(", {} evaluations", progress.evaluations));
                    }
                    None => {}
                }
                match left {
                    Some(left) => text.push_str(&format!(", {left}")),
                    None if seconds > 1.0 => text.push_str(&format!(", {seconds:.0} s")),
                    None => {}
                }
                Some(text)
            }
        }
    }
}

/// An open material.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) id: DocumentId,
    pub(crate) name: String,
    pub(crate) colour: Color32,
    pub(crate) visible: bool,
    pub(crate) source: Arc<Source>,
    /// The source as a table, once there is one.
    pub(crate) truth: Option<Arc<BrdfTable>>,
    pub(crate) spec: ModelSpec,
    /// The model that was last requested from the fitter.
    pub(crate) requested: Option<ModelSpec>,
    /// The number of that request.
    pub(crate) request: u64,
    pub(crate) fitted: Option<Fitted>,
    /// The hyper-parameters that the last search found: the defaults of the sliders.
    pub(crate) optimum: Option<Hyper>,
    pub(crate) work: Work,
    /// What to measure next.
    pub(crate) planned: Option<Planned>,
}

/// Colours for lines that colour-blind readers can tell apart: M. Okabe and K. Ito, "Color Universal Design"
/// (2008).
const PALETTE: [Color32; 7] = [
    Color32::from_rgb(0xE6, 0x9F, 0x00),
    Color32::from_rgb(0x56, 0xB4, 0xE9),
    Color32::from_rgb(0x00, 0x9E, 0x73),
    Color32::from_rgb(0xD5, 0x5E, 0x00),
    Color32::from_rgb(0xCC, 0x79, 0xA7),
    Color32::from_rgb(0x00, 0x72, 0xB2),
    Color32::from_rgb(0xF0, 0xE4, 0x42),
];

impl Document {
    pub(crate) fn new(id: DocumentId, source: Source) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "a remainder")]
        let colour = PALETTE[(id.0 % PALETTE.len() as u64) as usize];
        Self {
            id,
            name: source.name.clone(),
            colour,
            visible: true,
            source: Arc::new(source),
            truth: None,
            spec: ModelSpec::interactive(),
            requested: None,
            request: 0,
            fitted: None,
            optimum: None,
            work: Work::Idle,
            planned: None,
        }
    }

    /// Whether the source can be evaluated at any direction, so that predictions can be compared with it:
    /// scattered samples and models cannot.
    pub(crate) fn source_is_truth(&self) -> bool {
        matches!(self.source.content, Content::Table(_) | Content::Function { .. })
    }

    /// Whether the source is scattered measurements, which are all used.
    pub(crate) fn is_scattered(&self) -> bool {
        matches!(self.source.content, Content::Samples(_))
    }

    /// Whether the source is a model already.
    pub(crate) fn is_model(&self) -> bool {
        matches!(self.source.content, Content::Model(_))
    }

    pub(crate) fn is_busy(&self) -> bool {
        matches!(self.work, Work::Waiting | Work::Running { .. })
    }

    /// Whether the model that is wanted has been fitted, or will not be.
    pub(crate) fn is_fitted(&self) -> bool {
        match self.work {
            Work::Failed(_) | Work::Cancelled => true,
            Work::Idle => self.fitted.is_some() && self.requested.as_ref() == Some(&self.spec),
            Work::Waiting | Work::Running { .. } => false,
        }
    }

    /// The result of this number, unless a newer one has replaced it.
    pub(crate) fn result_mut(&mut self, version: u64) -> Option<&mut Fitted> {
        self.fitted.as_mut().filter(|f| f.version == version)
    }

    /// The truth at a pair of directions: from its table once there is one, from the source until then.
    pub(crate) fn truth_at(&self, angles: HalfDiff) -> Option<Rgb> {
        match &self.truth {
            Some(table) => Some(table.eval_half_diff(angles)),
            None if self.source_is_truth() => self.source.brdf().ok().map(|brdf| brdf.eval_half_diff(angles)),
            None => None,
        }
    }

    /// What to measure next, once it is planned.
    pub(crate) fn plan(&self) -> Option<&Plan> {
        self.planned.as_ref()?.plan.as_ref().ok()
    }

    /// Takes what its file says now in place of what it said before.
    pub(crate) fn renew(&mut self, source: Arc<Source>) {
        self.source = source;
        (self.truth, self.requested) = (None, None);
    }

    /// Has the model that is wanted fitted again, after an error or because the user has cancelled it.
    pub(crate) fn retry(&mut self) {
        self.requested = None;
    }

    /// Lets the search find the hyper-parameters again.
    pub(crate) fn optimise(&mut self) {
        self.spec.hyper = None;
        self.requested = None;
    }
}
