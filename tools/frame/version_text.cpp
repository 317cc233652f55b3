#include "tools/frame/version_text.h"

#include <link.h>

#include <filesystem>
#include <set>
#include <utility>

#include <fmt/format.h>

namespace tessera::cli {
namespace {

/// By the beginning of a file's name; what a whole that holds it must be is "GPL" where it says so.
constexpr std::pair<const char*, const char*> kLicences[] = {
    // one line per library, alphabetical
    {"ld-linux", "LGPL"},
    {"libamd.", "BSD"},
    {"libc.", "LGPL"},
    {"libexpat.", "MIT"},
    {"libfmt.", "MIT"},
    {"libgcc_s.", "GPL with the runtime exception"},
    {"libjpeg.", "BSD, IJG"},
    {"libm.", "LGPL"},
    {"libmeshoptimizer.", "MIT"},
    {"libmetis.", "Apache 2.0"},
    {"libpng16.", "libpng"},
    {"libspdlog.", "MIT"},
    {"libstdc++.", "GPL with the runtime exception"},
    {"libsuitesparseconfig.", "BSD"},
    {"libtbb.", "Apache 2.0"},
    {"libxxhash.", "BSD"},
    {"libz.", "zlib"},
    {"libzstd.", "BSD"},
};

std::string licence_of(const std::string& file) {
  for (const auto& [name, licence] : kLicences)
    if (file.starts_with(name)) return licence;
  return "see its package";
}

std::set<std::string> loaded_libraries() {
  std::set<std::string> names;
  dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* out) {
        const std::filesystem::path file = info->dlpi_name;
        if (file.has_parent_path()) static_cast<std::set<std::string>*>(out)->insert(file.filename());
        return 0;
      },
      &names);
  return names;
}

}  // namespace

std::string version_text(const std::string& program) {
#ifdef __AVX2__
  const char* processor = "x86-64-v3";
#else
  const char* processor = "x86-64";
#endif
  std::string text =
      fmt::format("{} {}\nbuilt by the compiler {} for {}\nlicence MIT; libraries loaded and theirs:\n",
                  program, TESSERA_VERSION, __VERSION__, processor);
  for (const std::string& file : loaded_libraries())
    text += fmt::format("  {:<28} {}\n", file, licence_of(file));
  text.pop_back();
  return text;
}

}  // namespace tessera::cli
