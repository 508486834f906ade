//! What the mouse and the keys do in the 3-D view: they turn the light of the sphere and orbit other objects.

use eframe::egui::{self, Rect, Ui};

use super::square;
use crate::viewer::state::look::{Orbit, SceneLook, Shape};
use crate::viewer::ui::navigate::{DRAG_LIGHT, DRAG_ORBIT, KEY_PLACE, KEY_TURN, ViewKeys};
use crate::viewer::ui::widgets::narrow;

/// Left drag turns the light of the sphere and orbits other objects, whose light turns with Ctrl. With Shift it moves
/// the line between truth and prediction. A double click resets.
pub(super) fn drag(ui: &Ui, response: &egui::Response, look: &mut SceneLook, picture: Rect) {
    let modifiers = ui.input(|i| i.modifiers);
    if response.double_clicked() {
        (look.orbit, look.swipe) = (Orbit::default(), 0.5);
        if look.shape == Shape::Sphere {
            look.light.reset();
        }
        return;
    }
    if !response.dragged_by(egui::PointerButton::Primary) {
        return;
    }
    let Some(at) = response.interact_pointer_pos() else { return };
    let delta = response.drag_delta();
    if modifiers.shift {
        look.swipe = ((at.x - picture.left()) / picture.width()).clamp(0.0, 1.0);
    } else if !modifiers.command && look.shape != Shape::Sphere {
        look.orbit.turn(-delta.x * DRAG_ORBIT, delta.y * DRAG_ORBIT);
    } else if look.light.point {
        let (disc, half) = (square(picture), 0.5 * square(picture).width());
        let place = [at.x - disc.center().x, disc.center().y - at.y].map(|x| f64::from(x / half));
        look.light.place(place);
    } else {
        look.light.yaw += f64::from(delta.x) * DRAG_LIGHT;
        look.light.pitch += f64::from(delta.y) * DRAG_LIGHT;
    }
}

/// Arrow keys turn the light of the sphere and orbit other objects.
pub(super) fn turn_by_keys(look: &mut SceneLook, keys: &ViewKeys) {
    let light = &mut look.light;
    if look.shape != Shape::Sphere {
        look.orbit.turn(-narrow(KEY_TURN * keys.right), narrow(KEY_TURN * keys.up));
    } else if light.point {
        light.place([light.at[0] + KEY_PLACE * keys.right, light.at[1] + KEY_PLACE * keys.up]);
    } else {
        light.yaw += KEY_TURN * keys.right;
        light.pitch -= KEY_TURN * keys.up;
    }
}
