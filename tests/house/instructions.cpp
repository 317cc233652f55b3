// The gate of instructions: what sources call of immintrin.h, the portable build has too.
#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>

#include "tests/house/house.h"

namespace tessera::house {

namespace {

constexpr const char kEmulation[] = "octree/avx2_emulation.h";
/// They name what is missing elsewhere: the emulation's test asks the processor, this file lists.
constexpr std::array kExempt = {kEmulation, "tests/octree/avx2_emulation_test.cpp",
                                "tests/house/instructions.cpp"};

/// What any x86-64 has (xmmintrin.h, emmintrin.h, without MMX): every operation of a row on every type of it.
constexpr std::array<std::array<const char*, 2>, 47> kSse2 = {{
    {"add sub", "epi8 epi16 epi32 epi64 pd ps sd ss"},
    {"mul div sqrt", "pd ps sd ss"},
    {"max min", "epi16 epu8 pd ps sd ss"},
    {"adds subs", "epi8 epi16 epu8 epu16"},
    {"and andnot or xor", "pd ps si128"},
    {"cmpeq cmpgt cmplt", "epi8 epi16 epi32 pd ps sd ss"},
    {"cmpge cmple cmpneq cmpnge cmpngt cmpnle cmpnlt cmpord cmpunord", "pd ps sd ss"},
    {"comieq comige comigt comile comilt comineq", "sd ss"},
    {"ucomieq ucomige ucomigt ucomile ucomilt ucomineq", "sd ss"},
    {"cvtepi32", "pd ps"},
    {"cvtpd cvttpd cvtps cvttps", "epi32"},
    {"cvtpd", "ps"},
    {"cvtps", "pd"},
    {"cvtsd cvtss cvttsd cvttss cvtsi128", "si32 si64"},
    {"cvtsi32 cvtsi64", "sd ss si128"},
    {"cvtsd", "f64 ss"},
    {"cvtss", "f32 sd"},
    {"castpd", "ps si128"},
    {"castps", "pd si128"},
    {"castsi128", "pd ps"},
    {"load store", "pd ps sd ss si128"},
    {"loadu storeu", "pd ps si128 si16 si32 si64"},
    {"load1 store1 loadr storer", "pd ps"},
    {"loadh loadl storeh storel", "pd"},
    {"loadl storel move", "epi64"},
    {"stream", "pd ps si128 si32 si64"},
    {"maskmoveu", "si128"},
    {"move", "sd ss"},
    {"movehl movelh", "ps"},
    {"movemask", "epi8 pd ps"},
    {"set setr", "epi8 epi16 epi32 pd ps"},
    {"set", "epi64x sd ss"},
    {"set1", "epi8 epi16 epi32 epi64x pd ps"},
    {"setzero undefined", "pd ps si128"},
    {"shuffle", "epi32 pd ps"},
    {"shufflehi shufflelo", "epi16"},
    {"unpackhi unpacklo", "epi8 epi16 epi32 epi64 pd ps"},
    {"packs", "epi16 epi32"},
    {"packus mullo madd extract insert", "epi16"},
    {"mulhi", "epi16 epu16"},
    {"mul", "epu32"},
    {"slli srli", "epi16 epi32 epi64 si128"},
    {"sll srl", "epi16 epi32 epi64"},
    {"sra srai", "epi16 epi32"},
    {"avg", "epu8 epu16"},
    {"sad", "epu8"},
    {"rcp rsqrt", "ps ss"},
}};
constexpr std::array kPlain = {"_mm_clflush", "_mm_free",  "_mm_getcsr",   "_mm_lfence", "_mm_malloc",
                               "_mm_mfence",  "_mm_pause", "_mm_prefetch", "_mm_setcsr", "_mm_sfence"};
/// Names without _mm that need more than that: BMI, population counts, halves; predicates; what is behind all of them.
constexpr std::array kOthers = {"_CMP_",    "__builtin_ia32_", "_pdep_u", "_pext_u", "_bzhi_u",  "_bextr_u",
                                "_blsi_u",  "_blsmsk_u",       "_blsr_u", "_andn_u", "_mulx_u",  "_tzcnt_u",
                                "_lzcnt_u", "_popcnt",         "_cvtss_", "_cvtsh_", "__andn_u", "__bextr_u",
                                "__bls",    "__tzcnt_u",       "__lzcnt"};

std::set<std::string> sse2_names() {
  std::set<std::string> names(kPlain.begin(), kPlain.end());
  for (const auto& [operations, types] : kSse2) {
    std::istringstream all(operations);
    for (std::string operation; all >> operation;) {
      std::istringstream of(types);
      for (std::string type; of >> type;) names.insert("_mm_" + operation + "_" + type);
    }
  }
  return names;
}

bool is_of_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

bool is_intrinsic(const std::string& word) {
  if (word.starts_with("_mm") && word.size() > 3)
    return word[3] == '_' || std::isdigit(static_cast<unsigned char>(word[3])) != 0;
  for (const char* other : kOthers)
    if (word.starts_with(other)) return true;
  return false;
}

/// Intrinsics that a line of code names.
std::vector<std::string> intrinsics_of(const std::string& code) {
  std::vector<std::string> out;
  for (std::size_t at = code.find('_'); at != std::string::npos; at = code.find('_', at)) {
    std::size_t end = at;
    while (end < code.size() && is_of_word(code[end])) ++end;
    if (at == 0 || !is_of_word(code[at - 1]))
      if (std::string word = code.substr(at, end - at); is_intrinsic(word)) out.push_back(std::move(word));
    at = end;
  }
  return out;
}

/// What the emulation defines, and the predicates that it compares by.
std::set<std::string> emulated_names(const Sources& sources) {
  std::set<std::string> names;
  for (const Source& s : sources) {
    if (s.path != kEmulation) continue;
    for (const std::string& line : s.lines) {
      const auto words = intrinsics_of(line);
      const bool names_one = line.starts_with("#define _") || line.find("case _CMP_") != std::string::npos;
      if (names_one && !words.empty()) names.insert(words.front());
    }
  }
  return names;
}

}  // namespace

Findings check_instructions(const Sources& sources) {
  std::set<std::string> known = sse2_names();
  known.merge(emulated_names(sources));
  Findings out;
  for (const Source& s : sources) {
    if (!s.is_header() && !s.is_cpp()) continue;
    if (std::find(kExempt.begin(), kExempt.end(), s.path) != kExempt.end()) continue;
    for (std::size_t i = 0; i < s.lines.size(); ++i)
      for (const std::string& word : intrinsics_of(code_of(s.lines[i])))
        if (known.count(word) == 0)
          out.push_back(s.path + ":" + std::to_string(i + 1) + ": " + word + " is not in SSE2, and " +
                        kEmulation + " does not name it: the portable build lacks it");
  }
  return out;
}

}  // namespace tessera::house
