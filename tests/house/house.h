/// \file house.h
/// The gates of the house: rules about the sources themselves, held by house_test. Every gate is a function of a list of
/// sources, so that a test can feed it a tiny house that breaks the rule and see it speak.
#pragma once
#include <map>
#include <set>
#include <string>
#include <vector>

namespace tessera::house {

/// One file: path from the root of the repository, and its lines.
struct Source {
  std::string path;
  std::vector<std::string> lines;

  bool is_header() const { return path.ends_with(".h"); }
  bool is_cpp() const { return path.ends_with(".cpp"); }
};
using Sources = std::vector<Source>;
/// What a gate found wrong, a sentence each, the path first; empty = the house is in order.
using Findings = std::vector<std::string>;

/// Every .h, .cpp and CMakeLists.txt of the floors and the tests, in the order of their paths.
Sources read_house(const std::string& root);

std::string folder_of(const std::string& path);  ///< "kernels/mesh/patch.cpp" -> "kernels/mesh"
std::string stem_of(const std::string& path);    ///< "kernels/mesh/patch.cpp" -> "kernels/mesh/patch"
std::string code_of(const std::string& line);    ///< the line without its // comment
std::string included(const std::string& line);   ///< what an #include "..." names, else ""
bool under(const std::string& path, const std::string& folder);  ///< in the folder or in one inside it

// Gates.
/// Includes between folders: only the arrows that rooms.cpp allows, no cycle.
Findings check_arrows(const Sources& sources);
/// At most 25 stems in a folder of the product.
Findings check_folder_sizes(const Sources& sources);
/// At most 600 lines a file, 350 a stage, 40 contract lines a header; every header begins with `/// \file NAME`.
Findings check_sizes(const Sources& sources);
/// Every .cpp has the header of its stem, is a part of a header (`parts`: file -> header that it includes) or a program.
Findings check_headers(const Sources& sources, const std::map<std::string, std::string>& parts);
/// Every kernel and every stage has a test of its stem, or stands in `covered` (stem -> test). Octree and solvers too.
Findings check_tests(const Sources& sources, const std::map<std::string, std::string>& covered);
/// Kernels, octree and solvers open no file, start no thread, print nothing and know no command-line word.
/// `allowed`: "path word" pairs with a reason.
Findings check_kernel_words(const Sources& sources, const std::map<std::string, std::string>& allowed);
/// Every intrinsic is of SSE2 or stands in octree/avx2_emulation.h, predicates of comparisons too: the portable build, which no test
/// compiles, has nothing else.
Findings check_instructions(const Sources& sources);
/// Headers keep OpenVDB, CLI11, JSON, fmt, spdlog, TBB and Eigen out, but for those named in `allowed`.
Findings check_heavy_headers(const Sources& sources, const std::set<std::string>& allowed);
/// Every .cpp stands in a CMakeLists.txt: nothing lies about that no build reads.
Findings check_listed(const Sources& sources);
/// Tests of what reads files of others are linked with those rooms alone (tests/reader_rooms.cmake), under the sanitizers only:
/// what they include of stream stands in these, or has a stem of `linked` besides. `apart`: tests that are not linked there.
Findings check_reader_tests(const Sources& sources, const std::set<std::string>& linked,
                            const std::set<std::string>& apart);
/// Every TEST_CASE has exactly one of the labels, its program's LABELS list has them all, and ctest can call it by name. What reads
/// ../shared/data is [.shared].
Findings check_labels(const Sources& sources);

// Tables about the real house (tables.cpp).
const std::map<std::string, std::string>& parts_of_headers();
const std::map<std::string, std::string>& covering_tests();
const std::map<std::string, std::string>& allowed_words();
const std::set<std::string>& allowed_heavy_headers();
const std::set<std::string>& linked_with_readers();
const std::set<std::string>& apart_from_readers();

}  // namespace tessera::house
