
#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "tests/fuzz/text_check.h"

// A plan of a work directory loads, and what it says loads as the same, or is told to be damaged.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  const fuzz::MemoryFile file(fuzz::text_of(data, size));
  fuzz::accepted([&] {
    const Plan plan = Plan::load(file.path());
    const fuzz::MemoryFile copy(dump_json(plan.to_json()));
    fuzz::require(Plan::load(copy.path()).to_json() == plan.to_json(), "a plan reads back as itself");
  });
  return 0;
}
