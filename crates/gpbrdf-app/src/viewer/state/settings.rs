//! What the program remembers from run to run.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::viewer::work::curves::CurveLook;
use crate::viewer::work::scene::{Orbit, Shape};
use crate::viewer::work::slices::SliceLook;
use crate::viewer::work::spheres::SphereLight;

/// Files kept in the list of recent ones.
const MAX_RECENT: usize = 12;

/// Which views share the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Arrangement {
    #[default]
    All,
    Slices,
    Plots,
    Sphere,
}

impl Arrangement {
    pub(crate) const ALL: [Self; 4] = [Self::All, Self::Slices, Self::Plots, Self::Sphere];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::All => "Overview",
            Self::Slices => "Slices",
            Self::Plots => "Plots",
            Self::Sphere => "3-D",
        }
    }
}

/// What the sphere view shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum SphereShown {
    /// Truth and prediction in one sphere, either side of a line.
    #[default]
    Swipe,
    SideBySide,
    Difference,
    Sigma,
}

impl SphereShown {
    pub(crate) const ALL: [Self; 4] = [Self::Swipe, Self::SideBySide, Self::Difference, Self::Sigma];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Swipe => "Swipe",
            Self::SideBySide => "Side by side",
            Self::Difference => "Difference",
            Self::Sigma => "Sigma",
        }
    }
}

/// Everything that is remembered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    pub(crate) recent: Vec<PathBuf>,
    /// None follows the system.
    pub(crate) dark: Option<bool>,
    pub(crate) zoom: f32,
    pub(crate) panels: bool,
    pub(crate) arrangement: Arrangement,
    /// What the overview shows where there is no room for all.
    pub(crate) tab: Arrangement,
    pub(crate) slices: SliceLook,
    pub(crate) show_samples: bool,
    pub(crate) show_regions: bool,
    pub(crate) curves: CurveLook,
    pub(crate) sphere: SphereShown,
    pub(crate) light: SphereLight,
    /// The file of the environment; none for the built-in one.
    pub(crate) environment: Option<PathBuf>,
    pub(crate) shape: Shape,
    pub(crate) orbit: Orbit,
    /// Where the sphere is divided, in `[0, 1]`.
    pub(crate) swipe: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            recent: Vec::new(),
            dark: Some(true),
            zoom: 1.0,
            panels: true,
            arrangement: Arrangement::All,
            tab: Arrangement::Sphere,
            slices: SliceLook::default(),
            show_samples: false,
            show_regions: false,
            curves: CurveLook::default(),
            sphere: SphereShown::Swipe,
            light: SphereLight::default(),
            environment: None,
            shape: Shape::Sphere,
            orbit: Orbit::default(),
            swipe: 0.5,
        }
    }
}

impl Settings {
    /// Puts a file at the head of the recent ones.
    pub(crate) fn remember(&mut self, path: &Path) {
        self.recent.retain(|p| p != path);
        self.recent.insert(0, path.to_owned());
        self.recent.truncate(MAX_RECENT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_and_what_is_missing_is_as_at_first() {
        let mut settings = Settings { zoom: 1.25, dark: Some(false), ..Settings::default() };
        settings.slices.square_theta_h = true;
        settings.remember(Path::new("a.binary"));
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings);
        let partial: Settings = serde_json::from_str("{\"zoom\": 2.0}").unwrap();
        assert_eq!(partial, Settings { zoom: 2.0, ..Settings::default() });
    }

    #[test]
    fn recent_files_are_few_and_the_newest_is_first() {
        let mut settings = Settings::default();
        for i in 0..20 {
            settings.remember(&PathBuf::from(format!("{i}.csv")));
        }
        settings.remember(Path::new("15.csv"));
        assert_eq!(settings.recent.len(), MAX_RECENT);
        assert_eq!(settings.recent[0], Path::new("15.csv"));
        assert_eq!(settings.recent.iter().filter(|p| *p == Path::new("15.csv")).count(), 1);
    }
}
