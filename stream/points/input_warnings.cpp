#include "stream/points/input_warnings.h"

#include "stream/files/path_text.h"

namespace tessera {

std::vector<std::string> input_warnings(const PointInputs& inputs) {
  constexpr std::size_t kMost = 32;
  std::vector<std::string> all;
  std::size_t left_out = 0;
  for (std::size_t i = 0; i < inputs.file_count(); ++i)
    for (const std::string& w : inputs.file(i).info().warnings) {
      if (all.size() < kMost)
        all.push_back(json_text(inputs.file(i).info().path) + ": " + w);
      else
        ++left_out;
    }
  if (left_out > 0)
    all.push_back(std::to_string(left_out) + " more warnings about input files: tessera info tells them");
  return all;
}

}  // namespace tessera
