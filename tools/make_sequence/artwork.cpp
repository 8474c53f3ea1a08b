#include "make_sequence/artwork.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace loopd::sequence {
namespace {

int texels(double metres) { return std::max(1, static_cast<int>(metres * kTexelsPerMetre + 0.5)); }

// Digits, 3 x 5 cells, top row in the highest three bits.
constexpr std::array<int, 10> kDigits = {075557, 026227, 071747, 071717, 055711,
                                         074717, 074757, 071122, 075757, 075717};

void draw_digit(Canvas& canvas, int x, int y, int scale, int digit, int grey) {
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 3; ++column) {
      const int bit = kDigits[static_cast<std::size_t>(digit)] >> ((4 - row) * 3 + (2 - column));
      if ((bit & 1) == 0) continue;
      canvas.rect(x + column * scale, y + row * scale, x + (column + 1) * scale,
                  y + (row + 1) * scale, grey);
    }
  }
}

/// A letter-like mark in a 5 x 7 cell: a few strokes between the points of a 3 x 3 raster.
void draw_glyph(Canvas& canvas, Random& random, double x, double y, double height, int grey) {
  const double cell = height / 2;
  const double width = height * 0.3;
  const int strokes = random.integer(2, 4);
  for (int i = 0; i < strokes; ++i) {
    const double x0 = x + random.integer(0, 2) * width;
    const double y0 = y + random.integer(0, 2) * cell;
    const bool upright = random.chance(0.5);
    const double x1 = upright ? x0 : x + random.integer(0, 2) * width;
    const double y1 = upright ? y + random.integer(0, 2) * cell : y0 + random.integer(-1, 1) * cell;
    canvas.stroke(x0, y0, x1, std::clamp(y1, y, y + height), std::max(1.0, height * 0.16), grey);
  }
}

void draw_words(Canvas& canvas, Random& random, double x0, double y, double x1, double height,
                int grey) {
  double x = x0;
  while (x < x1 - height) {
    const int letters = random.integer(2, 8);
    for (int i = 0; i < letters && x < x1 - height * 0.6; ++i, x += height * 0.85) {
      draw_glyph(canvas, random, x, y, height, grey);
    }
    x += height * 0.6;
  }
}

void draw_paragraph(Canvas& canvas, Random& random, int x0, int y0, int x1, int y1, double height,
                    int grey) {
  for (double y = y0; y + height < y1; y += height * 1.9) {
    draw_words(canvas, random, x0, y, random.uniform(0.7, 1.0) * (x1 - x0) + x0, height, grey);
  }
}

void draw_shape(Canvas& canvas, Random& random, int x0, int y0, int x1, int y1) {
  const auto px = [&] { return random.uniform(x0, x1); };
  const auto py = [&] { return random.uniform(y0, y1); };
  const int grey = random.integer(10, 245);
  const int kind = random.integer(0, 3);
  if (kind == 0) {
    canvas.disc(px(), py(), random.uniform(0.06, 0.25) * std::min(x1 - x0, y1 - y0), grey);
  } else if (kind == 1) {
    const double x[3] = {px(), px(), px()};
    const double y[3] = {py(), py(), py()};
    canvas.triangle(x, y, grey);
  } else if (kind == 2) {
    const int x = static_cast<int>(px());
    const int y = static_cast<int>(py());
    canvas.rect(x, y, std::min(x1, x + random.integer(8, 60)),
                std::min(y1, y + random.integer(8, 60)), grey);
  } else {
    canvas.stroke(px(), py(), px(), py(), random.uniform(2, 7), grey);
  }
}

/// A photograph-like patch: a gradient with overlapping shapes inside a box.
void draw_photo(Canvas& canvas, Random& random, int x0, int y0, int x1, int y1) {
  const int from = random.integer(30, 220);
  const int to = random.integer(30, 220);
  for (int y = y0; y < y1; ++y) {
    canvas.rect(x0, y, x1, y + 1, from + (to - from) * (y - y0) / std::max(1, y1 - y0));
  }
  Canvas inside(x1 - x0, y1 - y0, 0);
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) inside.set(x - x0, y - y0, canvas.at(x, y));
  }
  const int shapes = random.integer(4, 14);
  for (int i = 0; i < shapes; ++i) {
    draw_shape(inside, random, 0, 0, inside.width(), inside.height());
  }
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) canvas.set(x, y, inside.at(x - x0, y - y0));
  }
}

void draw_sheet(Canvas& canvas, Random& random, int x0, int y0, int x1, int y1) {
  canvas.rect(x0, y0, x1, y1, random.integer(205, 250));
  const int margin = std::max(3, (x1 - x0) / 12);
  const int ink = random.integer(20, 90);
  const int split = y0 + static_cast<int>(random.uniform(0.2, 0.6) * (y1 - y0));
  if (random.chance(0.6)) {
    draw_photo(canvas, random, x0 + margin, y0 + margin, x1 - margin, split);
  } else {
    draw_words(canvas, random, x0 + margin, y0 + margin, x1 - margin, random.uniform(8, 16), ink);
  }
  draw_paragraph(canvas, random, x0 + margin, split + margin, x1 - margin, y1 - margin,
                 random.uniform(4, 7), ink);
}

}  // namespace

Picture draw_poster(Random& random, double width_m, double height_m) {
  const bool dark = random.chance(0.3);
  Canvas canvas(texels(width_m), texels(height_m),
                dark ? random.integer(30, 90) : random.integer(200, 245));
  const int w = canvas.width();
  const int h = canvas.height();
  const int ink = dark ? random.integer(200, 245) : random.integer(15, 80);
  const int margin = w / 12 + 3;
  const double title = random.uniform(0.06, 0.12) * h;
  draw_words(canvas, random, margin, margin, w - margin, title, ink);
  int y = margin + static_cast<int>(title * 1.6);
  while (y < h - margin - 20) {
    const int block = random.integer(h / 7, h / 3);
    const int end = std::min(h - margin, y + block);
    const int middle = random.integer(w / 3, 2 * w / 3);
    if (random.chance(0.45)) {
      draw_photo(canvas, random, margin, y, middle, end);
      draw_paragraph(canvas, random, middle + 6, y, w - margin, end, random.uniform(5, 12), ink);
    } else if (random.chance(0.5)) {
      draw_photo(canvas, random, margin, y, w - margin, end);
    } else {
      draw_paragraph(canvas, random, margin, y, w - margin, end, random.uniform(6, 16), ink);
    }
    y = end + margin / 2;
  }
  canvas.outline(0, 0, w, h, 3, dark ? 15 : 110);
  return Picture(canvas);
}

Picture draw_notice_board(Random& random, double width_m, double height_m) {
  Canvas canvas(texels(width_m), texels(height_m), 135);
  const int w = canvas.width();
  const int h = canvas.height();
  const int sheets = random.integer(5, 11);
  for (int i = 0; i < sheets; ++i) {
    const bool landscape = random.chance(0.3);
    const int sheet_w = texels(landscape ? 0.297 : 0.21);
    const int sheet_h = texels(landscape ? 0.21 : 0.297);
    const int x = random.integer(12, std::max(13, w - sheet_w - 12));
    const int y = random.integer(12, std::max(13, h - sheet_h - 12));
    draw_sheet(canvas, random, x, y, x + sheet_w, y + sheet_h);
    canvas.disc(x + sheet_w / 2.0, y + 5, 3, 30);
  }
  canvas.outline(0, 0, w, h, 10, 60);
  return Picture(canvas);
}

Picture draw_plate(Random& random, int room) {
  Canvas canvas(80, 56, 235);
  canvas.outline(0, 0, 80, 56, 2, 70);
  const int scale = 5;
  for (int i = 0, rest = room; i < 3; ++i, rest /= 10) {
    draw_digit(canvas, 53 - i * 20, 6, scale, rest % 10, 25);
  }
  draw_words(canvas, random, 6, 38, 74, 5, 60);
  draw_words(canvas, random, 6, 47, 60, 4, 60);
  return Picture(canvas);
}

Picture draw_door(int style, bool handle_right, double width_m, double height_m) {
  Canvas canvas(texels(width_m), texels(height_m), style == 2 ? 168 : 138);
  const int w = canvas.width();
  const int h = canvas.height();
  if (style == 1) {
    canvas.rect(w * 3 / 10, h / 8, w * 7 / 10, h * 2 / 5, 75);
    canvas.outline(w * 3 / 10 - 5, h / 8 - 5, w * 7 / 10 + 5, h * 2 / 5 + 5, 5, 105);
  }
  if (style == 2) {
    canvas.outline(w / 7, h / 10, w * 6 / 7, h * 9 / 20, 5, 125);
    canvas.outline(w / 7, h * 11 / 20, w * 6 / 7, h * 9 / 10, 5, 125);
  }
  if (style == 3) {
    canvas.rect(w / 8, h / 12, w * 7 / 8, h * 8 / 10, 88);
    canvas.outline(w / 8, h / 12, w * 7 / 8, h * 8 / 10, 6, 190);
    canvas.rect(w / 8, h * 9 / 20, w * 7 / 8, h * 9 / 20 + 8, 190);
  }
  if (style != 2) canvas.rect(8, h - texels(0.22), w - 8, h - 8, 178);  // kick plate
  const int edge = handle_right ? w - texels(0.08) : texels(0.08);
  const int lever = handle_right ? edge - texels(0.11) : edge + texels(0.11);
  const int y = h - texels(1.05);
  canvas.rect(edge - 8, y - 26, edge + 8, y + 50, 205);
  canvas.stroke(edge, y, lever, y, 8, 40);
  canvas.disc(edge, y + 32, 4, 25);
  canvas.outline(0, 0, w, h, 3, 60);
  return Picture(canvas);
}

Picture draw_window(double width_m, double height_m, int panes) {
  Canvas canvas(texels(width_m), texels(height_m), 240);
  const int w = canvas.width();
  const int h = canvas.height();
  for (int y = h * 6 / 10; y < h; ++y) canvas.rect(0, y, w, y + 1, 205);
  for (int i = 1; i < panes; ++i) canvas.rect(w * i / panes - 10, 0, w * i / panes + 10, h, 120);
  canvas.rect(0, h / 4 - 8, w, h / 4 + 8, 120);
  canvas.outline(0, 0, w, h, 20, 110);
  return Picture(canvas);
}

Picture draw_cabinet(Random& random, double width_m, double height_m) {
  Canvas canvas(texels(width_m), texels(height_m), random.integer(90, 170));
  const int w = canvas.width();
  const int h = canvas.height();
  const int drawers = random.integer(2, 5);
  for (int i = 0; i < drawers; ++i) {
    const int y0 = h * i / drawers;
    const int y1 = h * (i + 1) / drawers;
    canvas.outline(4, y0 + 3, w - 4, y1 - 3, 3, 55);
    canvas.rect(w / 2 - 24, y0 + 18, w / 2 + 24, y0 + 26, 40);
    canvas.rect(w / 2 - 20, y0 + 36, w / 2 + 20, y0 + 54, 225);
    draw_words(canvas, random, w / 2 - 17, y0 + 42, w / 2 + 18, 6, 40);
  }
  return Picture(canvas);
}

Picture draw_sign(Random& random, double width_m, double height_m) {
  Canvas canvas(texels(width_m), texels(height_m), 60);
  const int w = canvas.width();
  const int h = canvas.height();
  const bool left = random.chance(0.5);
  const double tip = left ? h * 0.25 : w - h * 0.25;
  const double back = left ? h * 0.75 : w - h * 0.75;
  const double x[3] = {tip, back, back};
  const double y[3] = {h * 0.5, h * 0.2, h * 0.8};
  canvas.triangle(x, y, 235);
  draw_words(canvas, random, left ? h : h * 0.25, h * 0.3, left ? w - h * 0.2 : w - h, h * 0.4,
             235);
  canvas.outline(0, 0, w, h, 3, 200);
  return Picture(canvas);
}

Picture draw_marks(Random& random) {
  Canvas canvas(200, 120, 255);
  const int marks = random.integer(2, 7);
  for (int i = 0; i < marks; ++i) {
    const double x = random.uniform(10, 190);
    const double y = random.uniform(10, 110);
    const int grey = random.integer(120, 225);
    if (random.chance(0.4)) {
      canvas.disc(x, y, random.uniform(1.5, 5), grey);
    } else {
      canvas.stroke(x, y, x + random.uniform(-40, 40), y + random.uniform(-18, 18),
                    random.uniform(1, 3), grey);
    }
  }
  return Picture(canvas);
}

Picture draw_switch(int gangs) {
  Canvas canvas(34 * gangs, 34, 240);
  for (int i = 0; i < gangs; ++i) {
    canvas.outline(34 * i, 0, 34 * (i + 1), 34, 2, 120);
    canvas.outline(34 * i + 7, 6, 34 * i + 27, 28, 2, 160);
  }
  return Picture(canvas);
}

}  // namespace loopd::sequence
