#include "stream/stages/surface/holes_stage.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/hole_limit.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kFixedBytes = std::uint64_t{8} << 20;

class HolesStage : public Stage {
 public:
  explicit HolesStage(const JobState& state)
      : limit_(hole_limit(reconstruct_options(state), Plan::of_work(state.work))),
        files_(list_loop_files(state.work)) {}

  std::string name() const override { return "holes"; }
  std::size_t task_count() const override { return files_.size(); }
  std::uint64_t units() const override { return files_.size(); }
  std::string unit_name() const override { return "batches"; }

  std::uint64_t task_bytes(std::size_t) const override { return hole_task_bytes(limit_.edges); }

  json run(std::size_t task, TaskContext& context) const override {
    const std::vector<NamedLoop> loops = load_loops(files_[task]);
    HoleFillings out;
    std::array<std::uint64_t, kHoleOutcomes> outcomes{};
    std::uint64_t stiff = 0;
    for (const NamedLoop& named : loops) {
      context.check_stop();
      // Near the origin the kernel's arithmetic is the same wherever the loop lies.
      HoleLoop loop = named.loop;
      Double3 corner = loop.position[0];
      for (double& c : corner) c = std::floor(c);
      for (auto* list : {&loop.position, &loop.opposite})
        for (Double3& p : *list)
          for (std::size_t a = 0; a < 3; ++a) p[a] -= corner[a];
      const HoleFilling filling = fill_hole(loop, limit_.width, limit_.min_cosine);
      ++outcomes[static_cast<std::size_t>(filling.outcome)];
      if (filling.outcome != HoleOutcome::kFilled) continue;
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
    const auto count = [&](HoleOutcome o) { return outcomes[static_cast<std::size_t>(o)]; };
    return {{"loops", loops.size()},
            {"filled", count(HoleOutcome::kFilled)},
            {"refused_taken", count(HoleOutcome::kTaken)},
            {"refused_outer", count(HoleOutcome::kOuter)},
            {"left_wide", count(HoleOutcome::kWide)},
            {"left_sharp", count(HoleOutcome::kSharp)},
            {"not_fair", stiff},
            {"vertices", out.position.size()},
            {"faces", out.faces.size()}};
  }

  std::uint64_t finish_bytes() const override { return kFixedBytes; }

  json finish(const std::vector<json>& summaries, TaskContext&) const override {
    json total = json::object();
    for (const char* key : {"loops", "filled", "refused_taken", "refused_outer", "left_wide", "left_sharp",
                            "not_fair", "vertices", "faces"}) {
      std::uint64_t sum = 0;
      for (const json& s : summaries) sum += s.at(key).get<std::uint64_t>();
      total[key] = sum;
    }
    return total;
  }

  std::vector<std::string> obsolete() const override {
    return limit_.edges == 0 ? std::vector<std::string>{} : std::vector<std::string>{"loops/"};
  }

 private:
  HoleLimit limit_;
  std::vector<std::filesystem::path> files_;
};

}  // namespace

std::unique_ptr<Stage> make_holes_stage(const JobState& state) {
  return std::make_unique<HolesStage>(state);
}

}  // namespace tessera
