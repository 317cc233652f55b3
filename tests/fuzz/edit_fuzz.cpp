// Edits, poses and control points of `deform`. An edit's own text parses as the edit.

#include "stream/files/json.h"
#include "stream/stages/deform/edit_script.h"
#include "tests/fuzz/text_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  if (size < 2) return 0;
  const fuzz::MemoryFile file(fuzz::text_of(data + 1, size - 1));
  switch (data[0] % 3) {
    case 0:
      fuzz::accepted([&] {
        const std::string text = read_edit_text(file.path());
        const EditScript script = parse_edit(text, "the edit");
        pose_of(script, script.handles);
      });
      break;
    case 1:
      fuzz::accepted([&] { read_poses(file.path()); });
      break;
    default:
      fuzz::accepted([&] { with_controls("", file.path()); });
      break;
  }
  return 0;
}
