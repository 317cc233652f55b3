#include "stream/formats/ply_header.h"

#include <algorithm>
#include <array>
#include <utility>

#include "octree/error.h"

namespace tessera {

namespace {

constexpr std::size_t kMaxHeaderBytes = std::size_t{4} << 20;
constexpr std::size_t kMaxProperties = 4096;

struct TypeName {
  std::string_view name;
  ScalarType type;
};
constexpr std::array kTypeNames = {
    TypeName{"char", ScalarType::kInt8},      TypeName{"int8", ScalarType::kInt8},
    TypeName{"uchar", ScalarType::kUint8},    TypeName{"uint8", ScalarType::kUint8},
    TypeName{"short", ScalarType::kInt16},    TypeName{"int16", ScalarType::kInt16},
    TypeName{"ushort", ScalarType::kUint16},  TypeName{"uint16", ScalarType::kUint16},
    TypeName{"int", ScalarType::kInt32},      TypeName{"int32", ScalarType::kInt32},
    TypeName{"uint", ScalarType::kUint32},    TypeName{"uint32", ScalarType::kUint32},
    TypeName{"int64", ScalarType::kInt64},    TypeName{"uint64", ScalarType::kUint64},
    TypeName{"float", ScalarType::kFloat32},  TypeName{"float32", ScalarType::kFloat32},
    TypeName{"double", ScalarType::kFloat64}, TypeName{"float64", ScalarType::kFloat64},
};

std::string_view take_word(std::string_view& text) {
  const std::size_t begin = std::min(text.find_first_not_of(" \t"), text.size());
  text.remove_prefix(begin);
  const std::size_t end = std::min(text.find_first_of(" \t"), text.size());
  const std::string_view word = text.substr(0, end);
  text.remove_prefix(end);
  return word;
}

std::string trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return std::string(text.substr(begin, text.find_last_not_of(" \t") - begin + 1));
}

constexpr std::array<std::string_view, 6> kKeywords = {"format",  "comment",  "obj_info",
                                                       "element", "property", "end_header"};
constexpr std::array<std::string_view, 7> kOtherWords = {
    "ply", "list", "ascii", "binary_little_endian", "binary_big_endian", "vertex", "face"};

/// Letters to insert, delete or exchange until one word is the other, case aside.
std::size_t edits(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t corner = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t same = corner + (lower(a[i]) == lower(b[j]) ? 0 : 1);
      corner = std::exchange(row[j + 1], std::min({same, row[j] + 1, row[j + 1] + 1}));
    }
  }
  return row.back();
}

/// A comment that lacks its keyword, and cannot be a line that means something and is misspelt.
bool is_prose(std::string_view line) {
  const auto is_control = [](char c) {
    return c >= 0 && c < ' ' && c != '\t';
  };  // below 0: any encoding of letters
  if (line.size() > 1000 || std::any_of(line.begin(), line.end(), is_control)) return false;
  std::size_t words = 0;
  for (std::string_view word = take_word(line); !word.empty(); word = take_word(line)) {
    const auto is_word = [&](std::string_view known) { return known == word; };
    if (std::any_of(kKeywords.begin(), kKeywords.end(), is_word) ||
        std::any_of(kOtherWords.begin(), kOtherWords.end(), is_word) ||
        std::any_of(kTypeNames.begin(), kTypeNames.end(), [&](const TypeName& t) { return t.name == word; }))
      return false;
    const auto is_near = [&](std::string_view known) { return edits(word, known) <= 2; };
    if (words++ == 0 && std::any_of(kKeywords.begin(), kKeywords.end(), is_near)) return false;
  }
  return words > 0;
}

/// Parses line by line; knows where it is for messages.
class HeaderParser {
 public:
  HeaderParser(const ReadFile& file, PlyHeader& header) : file_(file), header_(header) {}

  /// Returns true after end_header.
  bool line(std::string_view text) {
    ++header_.lines;
    const std::string_view whole = text;
    const std::string_view keyword = take_word(text);
    if (header_.lines == 1) {
      if (keyword != "ply") fail("does not start with 'ply'");
    } else if (keyword == "format") {
      format(text);
    } else if (keyword == "comment") {
      header_.comments.push_back(trimmed(text));
    } else if (keyword == "obj_info") {
      header_.obj_info.push_back(trimmed(text));
    } else if (keyword == "element") {
      element(text);
    } else if (keyword == "property") {
      property(text);
    } else if (keyword == "end_header") {
      if (!has_format_) fail("there is no 'format' line before end_header");
      return true;
    } else if (is_prose(whole)) {
      header_.warnings.push_back("line " + std::to_string(header_.lines) + " of the PLY header, '" +
                                 trimmed(whole.substr(0, 60)) + "', is taken for a comment");
      header_.comments.push_back(trimmed(whole));
    } else if (!keyword.empty()) {
      fail("unknown keyword '" + trimmed(whole.substr(0, 40)) + "'");
    }
    return false;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_.path().string() + ": line " + std::to_string(header_.lines) +
                     " of the PLY header: " + what);
  }

 private:
  void format(std::string_view text) {
    const std::string_view name = take_word(text);
    if (name == "ascii") {
      header_.encoding = PlyEncoding::kAscii;
    } else if (name == "binary_little_endian") {
      header_.encoding = PlyEncoding::kLittleEndian;
    } else if (name == "binary_big_endian") {
      header_.encoding = PlyEncoding::kBigEndian;
    } else {
      fail("unknown format '" + std::string(name) +
           "', expected ascii, binary_little_endian or binary_big_endian");
    }
    has_format_ = true;
  }

  void element(std::string_view text) {
    PlyElement e;
    e.name = take_word(text);
    std::string_view count = take_word(text);
    const std::string shown(count);
    if (e.name.empty()) fail("an element without a name");
    if (!take_count(count, e.count) || !count.empty()) {
      fail("the count '" + shown + "' of element '" + e.name + "' is not a number from 0 to 2^64-1");
    }
    header_.elements.push_back(std::move(e));
  }

  ScalarType type(std::string_view name) const {
    for (const TypeName& t : kTypeNames) {
      if (t.name == name) return t.type;
    }
    fail("unknown property type '" + std::string(name) + "'");
  }

  void property(std::string_view text) {
    if (header_.elements.empty()) fail("a property before any element");
    PlyProperty p;
    std::string_view word = take_word(text);
    if (word == "list") {
      p.list = true;
      p.count_type = type(take_word(text));
      if (scalar_is_float(p.count_type)) fail("the count of a list cannot be of a float type");
      word = take_word(text);
    }
    p.type = type(word);
    p.name = take_word(text);
    if (p.name.empty()) fail("a property without a name");
    PlyElement& owner = header_.elements.back();
    if (owner.properties.size() == kMaxProperties) {
      fail("element '" + owner.name + "' has more than " + std::to_string(kMaxProperties) + " properties");
    }
    if (!names_.empty() && names_owner_ != header_.elements.size()) names_.clear();
    names_owner_ = header_.elements.size();
    const auto at = std::lower_bound(names_.begin(), names_.end(), p.name);
    if (at != names_.end() && *at == p.name) {
      fail("property '" + p.name + "' of element '" + owner.name + "' is there twice");
    }
    names_.insert(at, p.name);
    owner.properties.push_back(std::move(p));
  }

  const ReadFile& file_;
  PlyHeader& header_;
  bool has_format_ = false;
  std::vector<std::string> names_;  ///< of the current element, sorted
  std::size_t names_owner_ = 0;
};

}  // namespace

bool PlyElement::has_list() const {
  return std::any_of(properties.begin(), properties.end(), [](const PlyProperty& p) { return p.list; });
}

std::size_t PlyElement::stride() const {
  return offset(properties.size());
}

int PlyElement::find(std::string_view property) const {
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (properties[i].name == property) return static_cast<int>(i);
  }
  return -1;
}

std::size_t PlyElement::offset(std::size_t property) const {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < property; ++i) bytes += scalar_bytes(properties[i].type);
  return bytes;
}

int PlyHeader::find(std::string_view element) const {
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].name == element) return static_cast<int>(i);
  }
  return -1;
}

std::string PlyHeader::encoding_name() const {
  switch (encoding) {
    case PlyEncoding::kAscii:
      return "ascii";
    case PlyEncoding::kLittleEndian:
      return "binary little endian";
    case PlyEncoding::kBigEndian:
      break;
  }
  return "binary big endian";
}

PlyHeader read_ply_header(const ReadFile& file) {
  PlyHeader header;
  HeaderParser parser(file, header);
  const std::uint64_t limit = std::min<std::uint64_t>(file.size(), kMaxHeaderBytes);
  ByteWindow window(file, 0, limit, std::size_t{1} << 16);
  const std::string_view magic = window.peek(5).substr(0, 5);
  if (magic.substr(0, 3) != "ply") throw InputError(file.path().string() + ": is not a PLY file");
  if (magic.size() == 5 && magic[3] == '\r' && magic[4] != '\n') header.line_end = '\r';
  while (true) {
    std::string_view text = window.peek(1);
    std::size_t end = text.find(header.line_end);
    if (end == std::string_view::npos) {
      text = window.peek(window.capacity());
      end = text.find(header.line_end);
    }
    // The last line of a file without elements may lack its end.
    if (end == std::string_view::npos && (text.empty() || window.remaining() > text.size())) break;
    const std::size_t bytes = std::min(end, text.size());
    std::string_view line = text.substr(0, bytes);
    while (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    const bool done = parser.line(line);
    window.skip(end == std::string_view::npos ? bytes : bytes + 1);
    if (done) {
      header.data_begin = window.offset();
      return header;
    }
  }
  parser.fail(file.size() > kMaxHeaderBytes ? "there is no end_header within the first 4 MiB"
                                            : "the file ends before end_header; it is truncated");
}

std::string surplus_sentence(std::uint64_t lines) {
  return std::to_string(lines) + (lines == 1 ? " line holds more values" : " lines hold more values") +
         " than the header declares; what is beyond is left out";
}

std::uint64_t skip_ply_elements(const PlyElement& element, bool big_endian, std::uint64_t count,
                                ByteWindow& window) {
  if (!element.has_list()) {
    const std::size_t stride = element.stride();
    if (stride == 0) return count;
    const std::uint64_t whole = std::min(count, window.remaining() / stride);
    window.skip(whole * stride);
    return whole;
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    for (const PlyProperty& p : element.properties) {
      const std::size_t head = scalar_bytes(p.list ? p.count_type : p.type);
      const std::string_view bytes = window.peek(head);
      if (bytes.size() < head) return i;
      std::uint64_t items = 0;
      if (p.list) items = load_integer(p.count_type, big_endian, bytes.data());
      window.skip(head);
      const std::size_t item = scalar_bytes(p.type);
      if (items > window.remaining() / item) return i;  // also a negative count, as two's complement
      window.skip(items * item);
    }
  }
  return count;
}

}  // namespace tessera
