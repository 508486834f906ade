//! An open material: its source, its truth, the model asked for and what has been fitted.

use std::sync::Arc;
use std::time::Instant;

use eframe::egui::Color32;
use gpbrdf_core::{
    BrdfTable, CellMetrics, Content, FitReport, Hyper, ImageMetrics, Model, SampleSet, Source,
};

use crate::viewer::spec::ModelSpec;

/// Names a document for as long as the program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct DocumentId(pub(crate) u64);

/// What the fitter has found for one request; later stages fill in what is `None`.
#[derive(Clone, Debug)]
pub(crate) struct Fitted {
    /// Tells this result from all others.
    pub(crate) version: u64,
    pub(crate) model: Arc<Model>,
    pub(crate) samples: Arc<SampleSet>,
    /// NaN where it is not known, as for a model from a file.
    pub(crate) log_marginal_likelihood: f64,
    /// How the search went; none where there was none.
    pub(crate) report: Option<FitReport>,
    pub(crate) mean: Arc<BrdfTable>,
    /// Standard deviation of the target in every cell.
    pub(crate) sigma: Option<Arc<BrdfTable>>,
    pub(crate) cells: Option<CellMetrics>,
    pub(crate) images: Option<ImageMetrics>,
    /// Seconds to sample, fit and bake the mean.
    pub(crate) seconds: [f64; 3],
}

/// Where the work on a document stands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Work {
    /// Nothing to do.
    Idle,
    /// Asked for, not begun.
    Waiting,
    /// In a stage, since when, after how many evaluations of the likelihood.
    Running { stage: &'static str, since: Instant, evaluations: usize },
    /// Given up by the user.
    Cancelled,
    /// Ended with a message.
    Failed(String),
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
    /// What was last asked of the fitter.
    pub(crate) asked: Option<ModelSpec>,
    pub(crate) fitted: Option<Fitted>,
    /// What the last search found: the defaults of the sliders.
    pub(crate) optimum: Option<Hyper>,
    pub(crate) work: Work,
}

/// Colours for lines that colour-blind readers can tell apart: M. Okabe and K. Ito, "Color Universal Design" (2008).
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
            spec: ModelSpec::default(),
            asked: None,
            fitted: None,
            optimum: None,
            work: Work::Idle,
        }
    }

    /// Whether the source says what the truth is anywhere: scattered samples and models do not.
    pub(crate) fn has_truth(&self) -> bool {
        matches!(self.source.content, Content::Table(_) | Content::Function(_))
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
}
