// Classes by height over the ground: every border between two of them.
#include <catch2/catch.hpp>

#include "kernels/points/height_classes.h"

namespace height_classes_test {

using namespace tessera;

TEST_CASE("height classes: each class has its range of heights", "[unit]") {
  HeightClasses classes;
  classes.noise = 100.0;
  const auto at = [&](double above, std::uint8_t kind = kGroundMeasured, double tolerance = 0.2,
                      bool roof = false, bool water = false) {
    return class_by_height(above, tolerance, kind, roof, water, classes);
  };
  CHECK(at(0.2) == kClassGround);
  CHECK(at(-0.2) == kClassGround);
  CHECK(at(0.2, kGroundMeasured, 0.2, false, true) == kClassWater);
  CHECK(at(0.21, kGroundMeasured, 0.2, false, true) == kClassLowVegetation);
  CHECK(at(0.21) == kClassLowVegetation);
  CHECK(at(0.5) == kClassMediumVegetation);
  CHECK(at(2.0) == kClassHighVegetation);
  CHECK(at(2.0, kGroundObject, 0.2, true) == kClassBuilding);
  CHECK(at(1.9, kGroundObject, 0.2, true) == kClassMediumVegetation);
  CHECK(at(100.0) == kClassHighVegetation);
  CHECK(at(100.1) == kClassNoise);
  CHECK(at(-1.0) == kClassUnassigned);
  CHECK(at(-1.0, kGroundPit) == kClassNoise);
  CHECK(at(1.0, kGroundPit) == kClassMediumVegetation);
  CHECK(at(1.0, kGroundObject, 1.5) == kClassGround);
  classes.noise = 0.0;
  CHECK(at(1e6) == kClassHighVegetation);
  classes.ground_only = true;
  CHECK(at(0.0) == kClassGround);
  CHECK(at(-1.0, kGroundPit) == kClassUnassigned);
  CHECK(at(3.0) == kClassUnassigned);
}

}  // namespace height_classes_test
