#include "stream/stages/decimate/pass_blocks.h"

#include <algorithm>
#include <utility>

#include "stream/check/mesh_compare.h"
#include "stream/files/json.h"
#include "stream/runtime/task_counts.h"

namespace tessera {
PassBlocks::PassBlocks(const JobState& state, const SimplifyStores& stores, const SimplifyPass& pass,
                       const Rules& rules)
    : in_(open_pass_input(state, stores, pass)), reference_(stores.full(state)) {
  if (rules.tolerance > 0.0) require_provable(reference_, rules.tolerance);
  double radius = rules.failed_radius;
  for (int round = pass.round - 1; round >= rules.first_round; --round, radius *= 4.0)
    failed_.add(read_failed_faces(state.work / failed_faces_file(round)), radius);
  for (int round = rules.first_round + 2; round <= pass.round; ++round) careful_ *= 0.5;
  blocks_ = rules.cut(in_, reference_);
  if (pass.round > rules.first_round) {
    SimplifyPass before = pass;
    --before.round;
    SimplifyPass next = before;
    ++next.pass;
    MeshStore in = open_pass_input(state, stores, before);
    std::vector<MeshBlockCut> blocks = rules.cut(in, reference_);
    before_.emplace(std::move(in), open_pass_input(state, stores, next), std::move(blocks));
  }
  first_ = tasks_by_faces(blocks_, rules.task_faces);
}

bool PassBlocks::copy_unchanged(const MeshBlockCut& cut, MeshFileWriter* writer, Json& sum,
                                TaskContext& context, MeshBlock* left) const {
  const MeshBlockCut* same = before_ ? before_->same(in_, cut, failed_) : nullptr;
  if (same == nullptr) return false;
  const std::uint64_t faces = before_->copy(*same, *writer);
  if (left != nullptr) *left = before_->left(*same);
  add_counts(sum, {{"faces_in", cut.faces}, {"faces_out", faces}, {"blocks_kept", 1}});
  context.advance(cut.faces);
  return true;
}

std::vector<std::uint64_t> PassBlocks::pinned_keys(const MeshBlock& block, TaskContext& context) const {
  return failed_.keys_near(block, [&] { context.check_stop(); });
}

}  // namespace tessera
