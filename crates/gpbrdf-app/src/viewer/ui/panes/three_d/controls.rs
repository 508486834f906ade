//! The menus of the 3-D view: which shape is shown from where, and what lights it.

use eframe::egui::Ui;

use super::{Message, ThreeD};
use crate::viewer::state::look::{Orbit, Shape, SphereLight};
use crate::viewer::ui::pane::{Order, PaneContext, Shown};
use crate::viewer::ui::widgets::{Number, narrow};
use crate::viewer::work::dialogs::{Access, Question};

impl ThreeD {
    /// The shape and the place of the eye.
    pub(super) fn shape_ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        let mut shapes = vec![Shape::Sphere, Shape::Knot, Shape::RoundedBox];
        if let Shape::File(_) = &self.look.shape {
            shapes.push(self.look.shape.clone());
        }
        for shape in shapes {
            if ui.radio(self.look.shape == shape, shape.name()).clicked() {
                self.look.shape = shape;
            }
        }
        if ui.button("Mesh file…").clicked() {
            cx.order(Order::Ask(Question {
                title: "Object",
                help: "A Wavefront OBJ or glTF 2.0 file.",
                access: Access::Read { kind: "Meshes", endings: &["obj", "glb", "gltf"] },
                answer: self.outbox.map(|path| Message::Open(Shown::Mesh(path))),
            }));
            ui.close();
        }
        ui.separator();
        orbit_ui(ui, &mut self.look.orbit);
    }

    /// The light, the exposure and the line between truth and prediction.
    pub(super) fn light_ui(&mut self, ui: &mut Ui, cx: &mut PaneContext) {
        let light = &mut self.look.light;
        ui.radio_value(&mut light.point, false, format!("Environment: {}", self.map.name));
        ui.radio_value(&mut light.point, true, "Point light");
        Number::new("Exposure", -8.0..=8.0, 0.0, "Stops above or below the automatic exposure")
            .row_ui(ui, &mut light.exposure);
        let help = "Where truth ends and prediction begins, as a share of the width";
        narrow_ui(ui, &Number::new("Swipe", 0.0..=1.0, 0.5, help), &mut self.look.swipe);
        if light.point {
            place_ui(ui, light);
        } else {
            degrees_ui(ui, "Turned", "The environment about the vertical axis", &mut light.yaw);
            degrees_ui(ui, "Tilted", "The environment about the horizontal axis", &mut light.pitch);
        }
        ui.separator();
        if ui.button("Environment map…").clicked() {
            cx.order(Order::Ask(Question {
                title: "Environment",
                help: "A latitude-longitude map, .hdr or .exr.",
                access: Access::Read { kind: "Environment maps", endings: &["hdr", "exr"] },
                answer: self.outbox.map(|path| Message::Open(Shown::Environment(path))),
            }));
            ui.close();
        }
        if ui.button("Built-in studio").clicked() {
            self.use_studio();
        }
    }
}

/// A number in single precision.
fn narrow_ui(ui: &mut Ui, number: &Number<'_>, value: &mut f32) {
    let mut shown = f64::from(*value);
    if number.clone().row_ui(ui, &mut shown) {
        *value = narrow(shown);
    }
}

fn orbit_ui(ui: &mut Ui, orbit: &mut Orbit) {
    let usual = Orbit::default();
    let mut angle = |label, most: f64, usual: f32, help, radians: &mut f32| {
        let mut number = Number::new(label, -most..=most, f64::from(usual.to_degrees()), help);
        number.suffix = "°";
        let mut shown = f64::from(radians.to_degrees());
        if number.row_ui(ui, &mut shown) {
            *radians = narrow(shown.to_radians());
        }
    };
    angle("Azimuth", 180.0, usual.azimuth, "Of the eye about an object, degrees", &mut orbit.azimuth);
    angle("Elevation", 85.0, usual.elevation, "Of the eye over an object, degrees", &mut orbit.elevation);
    let help = "How large it is, as a factor";
    narrow_ui(ui, &Number::new("Zoom", 0.3..=6.0, f64::from(usual.zoom), help), &mut orbit.zoom);
}

/// The place of the point light.
fn place_ui(ui: &mut Ui, light: &mut SphereLight) {
    let fallback = SphereLight::default().at;
    let mut at = light.at;
    let mut changed = false;
    for (k, name) in ["Light x", "Light y"].into_iter().enumerate() {
        let number = Number::new(
            name,
            -1.0..=1.0,
            fallback[k],
            "Where the light is over the disc, in units of its radius",
        );
        changed |= number.row_ui(ui, &mut at[k]);
    }
    if changed {
        light.place(at);
    }
}

/// An angle, which is shown in degrees.
fn degrees_ui(ui: &mut Ui, label: &str, help: &str, radians: &mut f64) {
    let mut shown = radians.to_degrees();
    let mut number = Number::new(label, -180.0..=180.0, 0.0, help);
    number.suffix = "°";
    if number.row_ui(ui, &mut shown) {
        *radians = shown.to_radians();
    }
}
