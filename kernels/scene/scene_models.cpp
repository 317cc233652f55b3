#include "kernels/scene/scene_models.h"

#include <algorithm>

#include "kernels/scene/implicit_scene.h"

namespace tessera::synth {
namespace {

Primitive minus(Primitive p) {
  p.join = Join::kSubtract;
  return p;
}

/// The same primitive moved and turned about the world's z through the origin of the part.
struct Part {
  std::vector<Primitive>& out;
  Double3 at{};
  double angle = 0.0;
  void operator()(Primitive p) const {
    const SinCos t = sin_cos(angle);
    p.centre = Double3{p.centre[0] * t.cos - p.centre[1] * t.sin, p.centre[0] * t.sin + p.centre[1] * t.cos,
                       p.centre[2]} +
               at;
    out.push_back(p.rotated(angle));
  }
};

Primitive lying(Primitive p, const Double3& axis) {
  return p.along(axis);
}

void add_bracket(const Part& part) {
  part(box({0, 0, 0.08}, {0.7, 0.5, 0.08}, 0.03).painted(188, 74, 60));
  part(box({-0.6, 0, 0.5}, {0.1, 0.5, 0.5}, 0.03, 0.18).painted(188, 74, 60));
  part(box({-0.3, 0, 0.2}, {0.3, 0.05, 0.14}, 0.02, 0.12).painted(188, 74, 60));
  for (const double y : {-0.3, 0.3}) {
    part(minus(cylinder({0.4, y, 0.1}, 0.1, 0.3)).painted(120, 60, 50));
    part(minus(cylinder({0.4, y, 0.2}, 0.16, 0.08)).painted(120, 60, 50));
  }
  part(minus(lying(cylinder({-0.6, 0, 0.65}, 0.2, 0.3), {1, 0, 0})).painted(120, 60, 50));
}

void add_tee(const Part& part) {
  const auto pipe = [](Primitive p) { return p.painted(92, 128, 168); };
  part(pipe(lying(cylinder({0, 0, 0.42}, 0.26, 0.85), {1, 0, 0})));
  part(pipe(cylinder({0, 0, 0.75}, 0.22, 0.5, 0.0, 0.16)));
  for (const double side : {-1.0, 1.0})
    part(pipe(lying(cylinder({side * 0.85, 0, 0.42}, 0.41, 0.07, 0.015, 0.05), {1, 0, 0})));
  part(pipe(cylinder({0, 0, 1.22}, 0.36, 0.06, 0.015, 0.05)));
  for (int k = 0; k < 6; ++k) {
    const SinCos t = sin_cos(kPi / 3.0 * k + 0.3);
    part(cylinder({0.29 * t.cos, 0.29 * t.sin, 1.29}, 0.045, 0.05, 0.01).painted(210, 190, 90));
    for (const double side : {-1.0, 1.0}) {
      part(minus(lying(cylinder({side * 0.9, 0.335 * t.cos, 0.42 + 0.335 * t.sin}, 0.035, 0.2), {1, 0, 0}))
               .painted(70, 90, 120));
    }
  }
  part(minus(lying(cylinder({0, 0, 0.42}, 0.18, 1.2), {1, 0, 0})).painted(70, 90, 120));
  part(minus(cylinder({0, 0, 1.0}, 0.15, 0.6)).painted(70, 90, 120));
}

void add_gear(const Part& part) {
  const auto brass = [](Primitive p) { return p.painted(200, 160, 72); };
  part(brass(cylinder({0, 0, 0.14}, 0.5, 0.14, 0.01)));
  for (int k = 0; k < 18; ++k) {
    const double a = 2.0 * kPi / 18 * k;
    const SinCos t = sin_cos(a);
    part(brass(box({0.55 * t.cos, 0.55 * t.sin, 0.14}, {0.1, 0.045, 0.14}, 0.012, 0.03).rotated(a)));
  }
  part(minus(torus({0, 0, 0.3}, 0.33, 0.09)).painted(150, 120, 60));
  part(brass(cylinder({0, 0, 0.22}, 0.19, 0.22, 0.02, 0.05)));
  part(minus(cylinder({0, 0, 0.3}, 0.1, 0.5)).painted(150, 120, 60));
  part(minus(box({0.1, 0, 0.3}, {0.045, 0.03, 0.5})).painted(150, 120, 60));
}

void add_pillow_block(const Part& part) {
  const auto iron = [](Primitive p) { return p.painted(104, 148, 110); };
  part(iron(box({0, 0, 0.08}, {0.75, 0.26, 0.08}, 0.04)));
  part(iron(lying(cylinder({0, 0, 0.45}, 0.36, 0.24, 0.03, 0.14), {0, 1, 0})));
  part(iron(ball({0, 0, 0.82}, 0.08, 0.06)));
  for (const double side : {-1.0, 1.0}) {
    part(minus(cylinder({side * 0.58, 0, 0.1}, 0.08, 0.3)).painted(70, 100, 74));
    part(iron(round_cone({side * 0.45, 0, 0.14}, {side * 0.2, 0, 0.5}, 0.06, 0.05, 0.08)));
  }
  part(minus(lying(cylinder({0, 0, 0.45}, 0.2, 0.5), {0, 1, 0})).painted(70, 100, 74));
  part(minus(lying(cylinder({0, 0.24, 0.45}, 0.27, 0.06), {0, 1, 0})).painted(70, 100, 74));
}

}  // namespace

std::unique_ptr<Scene> make_parts() {
  ImplicitModel m;
  m.name = "parts";
  m.bounds = {{-2.6, -2.1, -0.3}, {2.6, 2.1, 1.45}};
  auto& p = m.primitives;
  p.push_back(box({0, 0, -0.15}, {2.5, 2.0, 0.15}, 0.05).painted(150, 146, 140));
  add_bracket({p, {-1.55, 0.9, 0}, 0.35});
  add_tee({p, {0.95, 0.75, 0}, -0.25});
  add_gear({p, {-0.35, -0.35, 0}, 0.1});
  add_pillow_block({p, {1.35, -1.05, 0}, 0.5});
  const Part loose{p, {0, 0, 0}, 0};
  loose(torus({-1.6, -1.2, 0.11}, 0.42, 0.12, 0.0).painted(60, 62, 70));
  loose(ball({-1.6, -1.2, 0.3}, 0.3).painted(196, 200, 206));
  loose(round_cone({-0.55, -1.5, 0.16}, {0.15, -1.35, 0.06}, 0.16, 0.06).painted(170, 90, 150));
  loose(box({-0.75, 0.75, 0.16}, {0.2, 0.2, 0.16})
            .rotated(0.6)
            .painted(90, 150, 170));  // sharp, no rounding at all
  return std::make_unique<ImplicitScene>(std::move(m));
}

std::unique_ptr<Scene> make_statue() {
  ImplicitModel m;
  m.name = "statue";
  m.bounds = {{-1.05, -1.05, 0.0}, {1.05, 1.05, 2.75}};
  m.skin.amplitude = 0.012;
  m.skin.wavelength = 0.16;
  m.skin.octaves = 3;
  m.skin.gain = 0.5;
  const auto add = [&m](Primitive p, int r, int g, int b) { m.primitives.push_back(p.painted(r, g, b)); };
  // Pedestal, turned.
  add(cylinder({0, 0, 0.1}, 0.98, 0.09), 150, 150, 146);
  add(cylinder({0, 0, 0.3}, 0.8, 0.2, 0.0, 0.1), 150, 150, 146);
  add(torus({0, 0, 0.42}, 0.8, 0.06, 0.03), 150, 150, 146);
  add(cylinder({0, 0, 0.52}, 0.86, 0.06, 0.02), 150, 150, 146);
  // Bear, facing -y.
  const auto fur = [&add](const Primitive& p) { add(p, 140, 96, 60); };
  fur(round_cone({0, 0.1, 0.95}, {0, 0.02, 1.5}, 0.46, 0.34, 0.05));
  fur(ball({0, -0.18, 1.0}, 0.36, 0.2));
  fur(ball({0, -0.08, 2.05}, 0.36, 0.18));
  fur(round_cone({0, -0.34, 1.98}, {0, -0.5, 1.95}, 0.19, 0.13, 0.1));
  for (const double s : {-1.0, 1.0}) {
    fur(ball({s * 0.28, 0.0, 2.36}, 0.13, 0.06));
    m.primitives.push_back(minus(ball({s * 0.29, -0.14, 2.38}, 0.07, 0.04)).painted(110, 70, 50));
    fur(round_cone({s * 0.36, -0.02, 1.62}, {s * 0.52, -0.3, 1.25}, 0.15, 0.12, 0.1));
    fur(round_cone({s * 0.52, -0.3, 1.25}, {s * 0.3, -0.52, 1.1}, 0.12, 0.11, 0.08));
    fur(round_cone({s * 0.34, -0.05, 0.8}, {s * 0.46, -0.55, 0.76}, 0.22, 0.16, 0.12));
    fur(round_cone({s * 0.46, -0.6, 0.74}, {s * 0.48, -0.66, 0.92}, 0.15, 0.12, 0.06));
    add(ball({s * 0.14, -0.38, 2.16}, 0.045, 0.01), 30, 26, 24);
  }
  add(ball({0, -0.62, 2.0}, 0.06, 0.03), 30, 26, 24);
  fur(ball({0, 0.55, 0.78}, 0.12, 0.08));
  return std::make_unique<ImplicitScene>(std::move(m));
}

std::unique_ptr<Scene> make_indoor() {
  ImplicitModel m;
  m.name = "indoor";
  m.bounds = {{-4.3, -3.3, -0.05}, {4.3, 3.3, 3.05}};
  auto& p = m.primitives;
  Primitive room = box({0, 0, 1.5}, {4, 3, 1.5}).painted(214, 208, 196);
  room.join = Join::kHollow;
  p.push_back(room);
  p.push_back(minus(box({4.0, 0.6, 1.4}, {0.25, 1.2, 0.7})).painted(180, 196, 210));  // window recesses
  p.push_back(minus(box({-1.0, 3.0, 1.4}, {1.0, 0.25, 0.7})).painted(180, 196, 210));
  p.push_back(minus(box({-4.0, -1.6, 1.05}, {0.2, 0.5, 1.05})).painted(150, 110, 76));  // door
  const Part room_part{p, {0, 0, 0}, 0};
  for (const double x : {-2.0, 2.0}) {
    room_part(cylinder({x, 2.2, 1.5}, 0.16, 1.6).painted(200, 196, 188));
    room_part(cylinder({x, 2.2, 0.1}, 0.24, 0.12, 0.02).painted(200, 196, 188));
    room_part(cylinder({x, 2.2, 2.92}, 0.24, 0.12, 0.02).painted(200, 196, 188));
  }
  for (int k = 0; k < 4; ++k)
    room_part(box({-3.0 + 2.0 * k, 0, 2.95}, {0.09, 3.1, 0.12}).painted(132, 96, 66));
  const Part table{p, {0.6, -0.3, 0}, 0.15};
  table(box({0, 0, 0.74}, {0.9, 0.5, 0.025}, 0.01).painted(160, 116, 72));
  for (const double x : {-0.8, 0.8}) {
    for (const double y : {-0.4, 0.4}) table(cylinder({x, y, 0.36}, 0.035, 0.37).painted(120, 86, 54));
  }
  table(round_cone({0.2, 0.1, 0.8}, {0.2, 0.1, 0.98}, 0.05, 0.09).painted(92, 128, 168));  // vase
  table(box({-0.35, -0.1, 0.785}, {0.15, 0.21, 0.02}).rotated(0.3).painted(170, 60, 60));  // book
  for (int k = 0; k < 4; ++k) {
    const double side = k % 2 ? 1.0 : -1.0;
    const Part chair{p, {0.6 + (k / 2 ? 0.42 : -0.42), -0.3 + side * 0.75, 0}, side > 0 ? 0.1 : kPi + 0.05};
    chair(box({0, 0, 0.45}, {0.21, 0.21, 0.025}, 0.015).painted(128, 92, 60));
    chair(box({0, 0.2, 0.72}, {0.2, 0.018, 0.17}, 0.01).painted(128, 92, 60));
    for (const double x : {-0.18, 0.18}) {
      chair(cylinder({x, 0.19, 0.42}, 0.02, 0.44).painted(96, 70, 48));
      chair(cylinder({x, -0.18, 0.22}, 0.02, 0.23).painted(96, 70, 48));
    }
  }
  const Part sofa{p, {-2.9, 0.9, 0}, kPi / 2};
  sofa(box({0, 0, 0.25}, {1.0, 0.42, 0.17}, 0.06).painted(86, 110, 140));
  sofa(box({0, 0.36, 0.55}, {1.0, 0.13, 0.35}, 0.08, 0.06).painted(86, 110, 140));
  for (const double x : {-1.0, 1.0})
    sofa(box({x, 0, 0.36}, {0.13, 0.45, 0.26}, 0.08, 0.05).painted(86, 110, 140));
  for (const double x : {-0.45, 0.45})
    sofa(box({x, -0.05, 0.46}, {0.42, 0.36, 0.09}, 0.06, 0.0).painted(110, 134, 160));
  const Part shelf{p, {2.6, -2.78, 0}, 0};
  for (const double x : {-0.9, 0.0, 0.9}) shelf(box({x, 0, 1.05}, {0.02, 0.18, 1.05}).painted(170, 140, 100));
  for (int k = 0; k < 6; ++k) {
    shelf(box({0, 0, 0.05 + 0.4 * k}, {0.9, 0.18, 0.015}).painted(170, 140, 100));
    for (int b = 0; b < 5 && k < 5; ++b) {
      const double u = to_unit(random_bits(4, static_cast<std::uint64_t>(k), static_cast<std::uint64_t>(b)));
      shelf(box({-0.75 + 0.34 * b, -0.02, 0.065 + 0.4 * k + 0.1 + 0.06 * u},
                {0.02 + 0.05 * u, 0.12, 0.1 + 0.06 * u})
                .painted(80 + static_cast<int>(140 * u), 90, 180 - static_cast<int>(100 * u)));
    }
  }
  const Part cupboard{p, {-3.65, -2.5, 0}, 0};
  cupboard(box({0, -0.1, 0.9}, {0.3, 0.35, 0.9}, 0.01).painted(190, 180, 160));
  cupboard(ball({0.32, -0.15, 0.95}, 0.03).painted(120, 120, 120));
  const Part plant{p, {3.4, 2.4, 0}, 0};
  plant(round_cone({0, 0, 0.18}, {0, 0, 0.4}, 0.16, 0.2).painted(180, 110, 80));
  for (int k = 0; k < 7; ++k) {
    const SinCos t = sin_cos(0.9 * k);
    plant(round_cone({0, 0, 0.5}, {0.38 * t.cos, 0.38 * t.sin, 0.95 + 0.09 * k}, 0.03, 0.09, 0.04)
              .painted(70, 130, 70));
  }
  const Part lamp{p, {-0.9, -2.3, 0}, 0};
  lamp(cylinder({0, 0, 0.02}, 0.2, 0.02, 0.01).painted(60, 60, 64));
  lamp(cylinder({0, 0, 0.8}, 0.02, 0.8, 0.0, 0.03).painted(60, 60, 64));
  lamp(round_cone({0, 0, 1.55}, {0, 0, 1.75}, 0.2, 0.12).painted(230, 220, 180));
  m.stations = {{0.2, 1.3, 1.6}, {-2.0, -1.5, 1.6}, {2.7, -1.2, 1.55}, {2.9, 1.6, 1.65}};
  return std::make_unique<ImplicitScene>(std::move(m));
}

std::unique_ptr<Scene> make_city() {
  ImplicitModel m;
  m.name = "city";
  m.ground = true;
  m.relief.amplitude = 14.0;
  m.relief.wavelength = 300.0;
  m.relief.octaves = 3;
  m.bounds = {{0, 0, -25}, {600, 600, 110}};
  const auto ground = [&m](double x, double y) {
    double z, sx, sy;
    fractal_heights(m.relief, {&x, 1}, {&y, 1}, {&z, 1}, {&sx, 1}, {&sy, 1});
    return z;
  };
  constexpr int kBlocks = 8;
  constexpr double kPitch = 600.0 / kBlocks;
  auto& p = m.primitives;
  for (int j = 0; j < kBlocks; ++j) {
    for (int i = 0; i < kBlocks; ++i) {
      std::uint64_t bits = random_bits(2, static_cast<std::uint64_t>(j), static_cast<std::uint64_t>(i));
      const auto next = [&bits] { return to_unit(bits = mix(bits)); };
      const double cx = (i + 0.5) * kPitch, cy = (j + 0.5) * kPitch;
      const double z = ground(cx, cy);
      const double what = next();
      if (what < 0.12) {  // park
        for (int k = 0; k < 9; ++k) {
          const double x = cx + 44.0 * (next() - 0.5), y = cy + 44.0 * (next() - 0.5), s = 3.0 + 3.0 * next();
          const double foot = ground(x, y);
          p.push_back(round_cone({x, y, foot - 1.0}, {x, y, foot + s}, 0.5, 0.4).painted(110, 84, 60));
          p.push_back(round_cone({x, y, foot + 1.4 * s}, {x, y, foot + 2.2 * s}, 0.75 * s, 0.5 * s, 0.6)
                          .painted(70, 120, 64));
        }
        continue;
      }
      const double w = 14.0 + 9.0 * next(), d = 14.0 + 9.0 * next();
      const double central = 1.0 - (std::fabs(i - 3.5) + std::fabs(j - 3.5)) / 8.0;
      const double high = 6.0 + 14.0 * next() + (next() < 0.5 ? 55.0 * central : 8.0 * central);
      const int tint = static_cast<int>(60 * next());
      const double yaw = 0.16 * (next() - 0.5);
      const Part house{p, {cx, cy, z}, yaw};
      house(box({0, 0, high / 2 - 6}, {w, d, high / 2 + 6}).painted(150 + tint, 140 + tint / 2, 130));
      if (what < 0.4) {  // set-back storeys
        house(box({0.15 * w, 0, high * 1.2}, {0.6 * w, 0.6 * d, 0.35 * high})
                  .painted(140, 150 + tint / 2, 160));
      } else if (what < 0.6) {  // pitched roof: a square bar on its edge
        Primitive roof = box({0, 0, high}, {w, 0.68 * d, 0.68 * d}).painted(170, 90, 70);
        constexpr double c = 0.70710678118654752440;
        roof.y = {0, c, c};
        roof.z = {0, -c, c};
        roof.centre[2] = high - 0.55 * d;
        house(roof);
      } else if (what < 0.72) {  // tower
        house(cylinder({0, 0, high}, 0.4 * w, 0.7 * high).painted(170, 176, 186));
        house(ball({0, 0, 1.7 * high}, 0.4 * w).painted(120, 160, 150));
      } else {  // court, with things on the roof
        house(minus(box({0, 0, high}, {0.5 * w, 0.5 * d, high - 3.0})).painted(160, 150, 140));
        house(box({0.75 * w, 0.75 * d, high + 1}, {2, 2, 2}).painted(120, 120, 124));
      }
    }
  }
  for (int k = 0; k <= kBlocks; k += 2) {
    for (int l = 0; l < kBlocks; ++l) {  // trees along the streets
      const double x = std::clamp(k * kPitch, 4.0, 596.0) + 4.0, y = (l + 0.3) * kPitch;
      const double foot = ground(x, y);
      p.push_back(round_cone({x, y, foot - 1.0}, {x, y, foot + 3.5}, 0.3, 0.25).painted(110, 84, 60));
      p.push_back(ball({x, y, foot + 5.5}, 2.4, 0.5).painted(70, 120, 64));
    }
  }
  for (const double x : {150.0, 300.0, 450.0}) {
    for (const double y : {150.0, 300.0, 450.0}) m.stations.push_back({x, y, ground(x, y) + 1.8});
  }
  return std::make_unique<ImplicitScene>(std::move(m));
}

}  // namespace tessera::synth
