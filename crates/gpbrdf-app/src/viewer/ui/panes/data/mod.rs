//! The measurements themselves and the lobe that the model makes of them, for one direction of the light.

mod hemisphere;
mod lobe;

use eframe::egui::{Rect, RichText, Ui, UiBuilder};
use serde::{Deserialize, Serialize};

use self::hemisphere::HemisphereView;
use self::lobe::LobeView;
use crate::viewer::state::look::Channel;
use crate::viewer::ui::pane::{Pane, PaneContext, Place, restored, saved};
use crate::viewer::ui::widgets::{Number, segments_ui, tool_ui};

/// What the pane remembers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Look {
    /// The angle between light and normal, degrees.
    incidence: f64,
    /// How far from it the light of the measurements that are shown may be, degrees.
    within: f64,
    channel: Channel,
    /// Whether the lobe is that of the truth.
    truth: bool,
    /// Where the eye is: its azimuth about the normal and its height over the surface, radians.
    azimuth: f64,
    elevation: f64,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            incidence: 45.0,
            within: 8.0,
            channel: Channel::Rgb,
            truth: false,
            azimuth: -0.5,
            elevation: 0.35,
        }
    }
}

/// The pane of data.
#[derive(Default)]
pub(crate) struct Data {
    look: Look,
    hemisphere: HemisphereView,
    lobe: LobeView,
}

impl Pane for Data {
    fn name(&self) -> &'static str {
        "data"
    }

    fn title(&self) -> &'static str {
        "Data"
    }

    fn place(&self) -> Place {
        Place::View(None)
    }

    fn settings(&self) -> serde_json::Value {
        saved(&self.look)
    }

    fn restore(&mut self, settings: &serde_json::Value) -> serde_json::Result<()> {
        self.look = restored(settings)?;
        Ok(())
    }

    fn ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        self.tools_ui(ui);
        let Some(document) = cx.documents.selected() else { return };
        let Some(fitted) = &document.fitted else {
            ui.label(document.work.text().unwrap_or_default());
            return;
        };
        let area = ui.available_rect_before_wrap();
        let (left, right) = if area.width() > area.height() {
            area.split_left_right_at_fraction(0.5)
        } else {
            area.split_top_bottom_at_fraction(0.5)
        };
        let part = |ui: &mut Ui, rect: Rect, salt: &str, draw: &mut dyn FnMut(&mut Ui)| {
            ui.scope_builder(UiBuilder::new().max_rect(rect.shrink(4.0)).id_salt(salt), |ui| draw(ui));
        };
        let mut home = false;
        let look = self.look;
        let reset = cx.reset_views;
        let hemisphere = &mut self.hemisphere;
        part(ui, left, "hemisphere", &mut |ui| home = hemisphere.ui(ui, document, fitted, &look, reset));
        part(ui, right, "lobe", &mut |ui| self.lobe.ui(ui, document, fitted, &mut self.look));
        cx.reset_next |= home;
    }
}

impl Data {
    fn tools_ui(&mut self, ui: &mut Ui) {
        let look = &mut self.look;
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new("Data").strong().size(15.0));
            ui.add_space(6.0);
            let help = "The angle between the light and the normal, degrees";
            let mut number = Number::new("Light θi", 0.0..=85.0, 45.0, help);
            (number.suffix, number.whole) = ("°", true);
            tool_ui(ui, number, 240.0, &mut look.incidence);
            let help = "How far from it the light of the measurements that are shown may be, degrees";
            let mut number = Number::new("Within", 1.0..=90.0, 8.0, help);
            (number.suffix, number.whole) = ("°", true);
            tool_ui(ui, number, 200.0, &mut look.within);
            let names = |c| if c == Channel::Rgb { "Mean" } else { Channel::name(c) };
            segments_ui(ui, &mut look.channel, &Channel::ALL, names);
            ui.separator();
            let which = |truth| if truth { "Truth" } else { "Prediction" };
            segments_ui(ui, &mut look.truth, &[false, true], which);
        });
    }
}
