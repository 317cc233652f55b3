#include "stream/stages/surface/hole_files.h"

#include "stream/files/durable_file.h"
#include "stream/stages/surface/hole_limit.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::hole_files_test {
namespace {

constexpr std::uint64_t kNew = HoleFillings::kNew;

/// Three fillings of triangles 10 i, 10 i + 1, 10 i + 2: a fan around one new vertex, a face without any, and a fan.
HoleFillings three_fillings() {
  HoleFillings all;
  for (std::uint32_t i = 0; i < 3; ++i) {
    const std::uint64_t rim = 10 * i, centre = kNew | all.position.size();
    if (i == 1) {
      all.faces.push_back({rim, rim + 1, rim + 2});
    } else {
      all.position.push_back({1.0 * i, 2.0, 3.0});
      all.rgba.push_back(i + 7);
      for (std::uint64_t k = 0; k < 3; ++k) all.faces.push_back({rim + k, rim + (k + 1) % 3, centre});
    }
    for (std::uint64_t k = 0; k < 3; ++k)
      all.rim.push_back({rim + k, {1.0 * i, 1.0, 0.5 * static_cast<double>(k)}});
    all.spans.push_back({i == 1 ? 0u : 1u, i == 1 ? 1u : 3u, 3, 0, {1.0 * i, 0, 0}, {1.0 * i, 1, 1}});
  }
  all.moved = {{10, {1, 2, 3}, 0}};
  return all;
}

}  // namespace

TEST_CASE("hole files: without one filling the others keep their vertices and faces", "[unit]") {
  const HoleFillings all = three_fillings();
  const HoleFillings rest = without_fillings(all, std::vector<std::uint8_t>{1, 0, 0});
  REQUIRE(rest.spans.size() == 2);
  CHECK(rest.position == std::vector<Double3>{{2.0, 2.0, 3.0}});
  CHECK(rest.rgba == std::vector<std::uint32_t>{9});
  CHECK(rest.faces == std::vector<std::array<std::uint64_t, 3>>{
                          {10, 11, 12}, {20, 21, kNew}, {21, 22, kNew}, {22, 20, kNew}});
  REQUIRE(rest.rim.size() == 6);
  CHECK(rest.rim[0].number == 10);
  CHECK(rest.rim[5].position == Double3{2.0, 1.0, 1.0});
  CHECK(rest.moved.size() == 1);
  CHECK(without_fillings(all, std::vector<std::uint8_t>{0, 0, 0}).faces == all.faces);
  CHECK(without_fillings(all, std::vector<std::uint8_t>{1, 1, 1}).faces.empty());
}

TEST_CASE("hole files: what was kept of a batch stands in for it", "[unit]") {
  const test::TempFolder folder;
  std::filesystem::create_directories(folder / "holes");
  std::filesystem::create_directories(folder / "holes-kept");
  const HoleFillings all = three_fillings();
  for (std::size_t batch = 0; batch < 2; ++batch) all.save(folder / filling_file_name(batch));
  const auto files = list_filling_files(folder.path());
  REQUIRE(files == list_all_filling_files(folder.path()));
  REQUIRE(files.size() == 2);
  without_fillings(all, std::vector<std::uint8_t>{0, 1, 1})
      .save(folder / kept_filling_file_name(files[1].filename().string()));
  const auto now = list_filling_files(folder.path());
  CHECK(now[0] == files[0]);
  CHECK(now[1] != files[1]);
  CHECK(load_fillings_head(now[0]).faces == 7);
  CHECK(load_fillings_head(now[1]).faces == 3);
  CHECK(load_filling_spans(now[1]).size() == 1);
  CHECK(HoleFillings::load(now[0]).rim.size() == 9);
}

TEST_CASE("hole limit: in noisy rooms wider holes are filled than elsewhere, narrower ones than from above",
          "[unit]") {
  ReconstructOptions options;
  Plan plan;
  plan.radius_cells = 3.0;
  plan.noise_cells = 0.1;
  const HoleLimit other = hole_limit(options, plan, HoleScene::kOther),
                  room = hole_limit(options, plan, HoleScene::kRoom),
                  above = hole_limit(options, plan, HoleScene::kAbove);
  CHECK(other.width == 3.0);
  CHECK(room.width == 10.0);
  CHECK(above.width == 20.0);
  CHECK((room.membranes && !other.membranes));
  CHECK((room.chained > room.edges && other.chained == 0));
  // Exact samples end where they say, and what the user asks for holds everywhere.
  plan.noise_cells = 0.0;
  CHECK(hole_limit(options, plan, HoleScene::kRoom).edges == 0);
  options.max_hole = "30";
  CHECK(hole_limit(options, plan, HoleScene::kRoom).edges == 30);
}

}  // namespace tessera::hole_files_test
