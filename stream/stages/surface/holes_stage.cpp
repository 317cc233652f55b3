#include "stream/stages/surface/holes_stage.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/hole_files.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kFixedBytes = std::uint64_t{8} << 20;

class HolesStage : public Stage {
 public:
  explicit HolesStage(const JobState& state)
      : most_edges_(reconstruct_options(state).max_hole), files_(list_loop_files(state.work)) {}

  std::string name() const override { return "holes"; }
  std::size_t task_count() const override { return files_.size(); }
  std::uint64_t units() const override { return files_.size(); }
  std::string unit_name() const override { return "batches"; }

  std::uint64_t task_bytes(std::size_t) const override { return hole_task_bytes(most_edges_); }

  json run(std::size_t task, TaskContext& context) const override {
    const std::vector<NamedLoop> loops = load_loops(files_[task]);
    HoleFillings out;
    std::uint64_t filled = 0, taken = 0, outer = 0, stiff = 0;
    for (const NamedLoop& named : loops) {
      context.check_stop();
      // Near the origin the kernel's arithmetic is the same wherever the loop lies.
      HoleLoop loop = named.loop;
      Double3 corner = loop.position[0];
      for (double& c : corner) c = std::floor(c);
      for (auto* list : {&loop.position, &loop.opposite})
        for (Double3& p : *list)
          for (std::size_t a = 0; a < 3; ++a) p[a] -= corner[a];
      const HoleFilling filling = fill_hole(loop);
      if (filling.outcome != HoleOutcome::kFilled) {
        (filling.outcome == HoleOutcome::kTaken ? taken : outer) += 1;
        continue;
      }
      ++filled;
      stiff += !filling.fair;
      const std::uint64_t base = out.position.size();
      for (Double3 p : filling.position) {
        for (std::size_t a = 0; a < 3; ++a) p[a] += corner[a];
        out.position.push_back(p);
      }
      out.rgba.insert(out.rgba.end(), filling.rgba.begin(), filling.rgba.end());
      const std::size_t n = named.vertex.size();
      for (const auto& f : filling.faces) {
        std::array<std::uint64_t, 3> face;
        for (std::size_t k = 0; k < 3; ++k)
          face[k] = f[k] < n ? named.vertex[f[k]] : HoleFillings::kNew | (base + f[k] - n);
        out.faces.push_back(face);
      }
    }
    out.save(context.create(filling_file_name(task)));
    context.advance(1);
    return {{"loops", loops.size()},    {"filled", filled},  {"refused_taken", taken},
            {"refused_outer", outer},   {"not_fair", stiff}, {"vertices", out.position.size()},
            {"faces", out.faces.size()}};
  }

  std::uint64_t finish_bytes() const override { return kFixedBytes; }

  json finish(const std::vector<json>& summaries, TaskContext&) const override {
    json total = {{"loops", 0},    {"filled", 0},   {"refused_taken", 0}, {"refused_outer", 0},
                  {"not_fair", 0}, {"vertices", 0}, {"faces", 0}};
    for (const json& s : summaries)
      for (auto& [key, value] : total.items())
        value = value.get<std::uint64_t>() + s.at(key).get<std::uint64_t>();
    return total;
  }

  std::vector<std::string> obsolete() const override {
    return most_edges_ == 0 ? std::vector<std::string>{} : std::vector<std::string>{"loops/"};
  }

 private:
  std::uint32_t most_edges_;
  std::vector<std::filesystem::path> files_;
};

}  // namespace

std::unique_ptr<Stage> make_holes_stage(const JobState& state) {
  return std::make_unique<HolesStage>(state);
}

}  // namespace tessera
