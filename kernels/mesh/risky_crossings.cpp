#include "kernels/mesh/risky_crossings.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

/// Unit cells of the core, some marked; what lies beyond counts to the outermost ones.
class MarkedCells {
 public:
  explicit MarkedCells(const ContactCell& core) : low_(core.low) {
    for (std::size_t a = 0; a < 3; ++a) size_[a] = static_cast<std::size_t>(core.high[a] - core.low[a]) + 1;
    marked_.resize(size_[0] * size_[1] * size_[2]);
  }
  void mark(const ContactFace& face) {
    any(face, [this](std::size_t cell) {
      marked_[cell] = 1;
      return false;
    });
  }
  bool meets(const ContactFace& face) const {
    return any(face, [this](std::size_t cell) { return marked_[cell] != 0; });
  }

 private:
  template <class Is>
  bool any(const ContactFace& face, Is&& is) const {
    std::array<std::size_t, 3> from{}, to{};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [low, high] = std::minmax({face.corner[0][a], face.corner[1][a], face.corner[2][a]});
      const auto last = static_cast<double>(size_[a] - 1);
      from[a] = static_cast<std::size_t>(std::clamp(low - low_[a], 0.0, last));
      to[a] = static_cast<std::size_t>(std::clamp(high - low_[a], 0.0, last));
    }
    for (std::size_t z = from[2]; z <= to[2]; ++z)
      for (std::size_t y = from[1]; y <= to[1]; ++y)
        for (std::size_t x = from[0]; x <= to[0]; ++x)
          if (is(x + size_[0] * (y + size_[1] * z))) return true;
    return false;
  }
  Double3 low_;
  std::array<std::size_t, 3> size_{};
  std::vector<std::uint8_t> marked_;
};

}  // namespace

void risky_crossings(std::span<const ContactFace> faces, std::span<const std::uint8_t> risky,
                     const ContactCell& core, const std::function<void(std::uint32_t, std::uint32_t)>& use) {
  if (std::find(risky.begin(), risky.end(), 1) == risky.end()) return;
  MarkedCells marked(core);
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (risky[f]) marked.mark(faces[f]);
  std::vector<ContactFace> near;
  std::vector<std::uint32_t> number;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto& c = faces[f].corner;
    if (!marked.meets(faces[f]) || collinear(c[0], c[1], c[2])) continue;
    near.push_back(faces[f]);
    number.push_back(static_cast<std::uint32_t>(f));
  }
  block_contacts(near, core, [&](std::uint32_t i, std::uint32_t j, FaceContact contact) {
    if (contact == FaceContact::kTouch || (!risky[number[i]] && !risky[number[j]])) return;
    use(number[i], number[j]);
  });
}

}  // namespace tessera
