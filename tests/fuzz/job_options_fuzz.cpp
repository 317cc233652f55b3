// The option tables of all jobs: a job file's values, and words as typed. What a table took it gives back, the same.

#include "stream/files/json.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/options.h"
#include "stream/stages/decimate/simplify_options.h"
#include "stream/stages/deform/deform_options.h"
#include "stream/stages/remesh/remesh_options.h"
#include "stream/stages/resample/resample_options.h"
#include "stream/stages/tiles/tiles_options.h"
#include "tests/fuzz/text_check.h"

namespace tessera {
namespace {

/// Words of a row are given as one text, parted by spaces.
std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t to = std::min(text.find(' ', from), text.size());
    if (to > from) words.push_back(text.substr(from, to - from));
    from = to + 1;
  }
  return words;
}

template <class Options>
void try_table(const std::string& text) {
  Options options;
  const OptionTable table = option_table(options);
  const bool took = fuzz::accepted([&] {
    if (text.starts_with('{')) {
      const Json values = try_parse_json(text);
      if (values.is_discarded()) throw UsageError("no JSON");
      table.from_json(values);
    } else {
      const std::size_t end = std::min(text.find('='), text.size());
      const OptionRow* row = table.find(text.substr(0, end));
      if (row == nullptr) throw UsageError("no such option");
      if (const auto words = words_of(text.substr(std::min(end + 1, text.size()))); !words.empty())
        row->set(words);
    }
  });
  if (!took) return;
  Options again;
  read_table_text(option_table(again), table_text(table));
  fuzz::require(table_text(option_table(again)) == table_text(table), "a table's text reads back as itself");
  if constexpr (requires { options.validate(); }) fuzz::accepted([&] { options.validate(); });
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  if (size < 2) return 0;
  const std::string text(fuzz::text_of(data + 1, size - 1));
  switch (data[0] % 7) {
    case 0:
      try_table<ReconstructOptions>(text);
      break;
    case 1:
      try_table<RunOptions>(text);
      break;
    case 2:
      try_table<SimplifyOptions>(text);
      break;
    case 3:
      try_table<RemeshJobOptions>(text);
      break;
    case 4:
      try_table<TilesOptions>(text);
      break;
    case 5:
      try_table<ResampleOptions>(text);
      break;
    default:
      try_table<DeformOptions>(text);
      break;
  }
  return 0;
}
