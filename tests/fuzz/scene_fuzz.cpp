// Scenes of solids: as a file, and as words. What reads is a tree of the meshes that it names, or is told why not.
#include <nlohmann/json.hpp>

#include "stream/stages/solid/csg_job.h"
#include "tests/fuzz/text_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  if (size < 2) return 0;
  const std::string_view text = fuzz::text_of(data + 1, size - 1);
  fuzz::told([&] {
    CsgScene scene;
    if (data[0] % 2 == 0) {
      const fuzz::MemoryFile file(text);
      scene = read_csg_scene(file.path());
    } else {
      std::vector<std::string> words;
      for (std::size_t from = 0; from <= text.size();) {
        const std::size_t to = std::min(text.find(' ', from), text.size());
        words.emplace_back(text.substr(from, to - from));
        from = to + 1;
      }
      scene = parse_csg_words(words);
    }
    const nlohmann::json program = nlohmann::json::parse(scene.program);
    fuzz::require(program.is_array() && !program.empty(), "a tree has steps");
    for (const nlohmann::json& step : program)
      fuzz::require(!step.contains("mesh") || step["mesh"].get<std::size_t>() < scene.meshes.size(),
                    "meshes are named");
  });
  return 0;
}
