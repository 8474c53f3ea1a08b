#pragma once

#include "make_sequence/picture.h"
#include "make_sequence/random.h"

namespace loopd::sequence {

/// Texels a metre of everything drawn here (2.5 mm a texel).
inline constexpr double kTexelsPerMetre = 400;

/// A poster of `width_m` x `height_m`: title, blocks of text, shapes and photograph-like patches.
Picture draw_poster(Random& random, double width_m, double height_m);
/// A cork board with pinned sheets.
Picture draw_notice_board(Random& random, double width_m, double height_m);
/// A door plate with a room number.
Picture draw_plate(Random& random, int room);
/// A door leaf, handle on the right or left; `style` 0 plain, 1 with a pane, 2 with panels, 3
/// glazed.
Picture draw_door(int style, bool handle_right, double width_m, double height_m);
/// A window with mullions.
Picture draw_window(double width_m, double height_m, int panes);
/// A cabinet front with drawers.
Picture draw_cabinet(Random& random, double width_m, double height_m);
/// A direction sign with an arrow and words.
Picture draw_sign(Random& random, double width_m, double height_m);
/// Scratches and stains: white is untouched wall.
Picture draw_marks(Random& random);
/// A light switch or socket.
Picture draw_switch(int gangs);

}  // namespace loopd::sequence
