// Whatever JSON a report holds, it makes a page, and no tag of the page comes from it.
#include "stream/files/json.h"
#include "stream/page/page_text.h"

#include "tests/fuzz/point_reader_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tessera::Json report = tessera::try_parse_json(std::string(data, data + size));
  if (report.is_discarded()) return 0;
  const std::string page = tessera::page_text(report, {});
  tessera::fuzz::require(page.starts_with("<!DOCTYPE html>"), "a page");
  tessera::fuzz::require(page.find("<fuzz") == std::string::npos, "a tag of the report's own");
  tessera::fuzz::require(page == tessera::page_text(report, {}), "a pure function");
  return 0;
}
