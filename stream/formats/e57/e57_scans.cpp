#include "stream/formats/e57/e57_scans.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "octree/error.h"
#include "stream/formats/scalar.h"
#include "stream/formats/xml_events.h"

namespace tessera {

namespace {

constexpr std::size_t kDeepest = 64;
constexpr std::size_t kLongestText = 256;  ///< of an element that is a number
constexpr std::size_t kMaxScans = 16384;   ///< each takes about 2 KB

struct UseName {
  std::string_view name;
  E57Use use;
};
constexpr std::array kUseNames = {
    UseName{"cartesianX", E57Use::kX},
    UseName{"cartesianY", E57Use::kY},
    UseName{"cartesianZ", E57Use::kZ},
    UseName{"sphericalRange", E57Use::kRange},
    UseName{"sphericalAzimuth", E57Use::kAzimuth},
    UseName{"sphericalElevation", E57Use::kElevation},
    UseName{"colorRed", E57Use::kRed},
    UseName{"colorGreen", E57Use::kGreen},
    UseName{"colorBlue", E57Use::kBlue},
    UseName{"nor:normalX", E57Use::kNormalX},
    UseName{"nor:normalY", E57Use::kNormalY},
    UseName{"nor:normalZ", E57Use::kNormalZ},
    UseName{"cartesianInvalidState", E57Use::kCartesianState},
    UseName{"sphericalInvalidState", E57Use::kSphericalState},
    UseName{"isColorInvalid", E57Use::kColourState},
    UseName{"returnIndex", E57Use::kReturn},
    UseName{"returnCount", E57Use::kReturns},
    UseName{"intensity", E57Use::kIntensity},
    UseName{"rowIndex", E57Use::kRow},
    UseName{"columnIndex", E57Use::kColumn},
};

constexpr std::array<std::string_view, 6> kBoundNames = {"xMinimum", "xMaximum", "yMinimum",
                                                         "yMaximum", "zMinimum", "zMaximum"};
constexpr std::array<std::string_view, 6> kColourNames = {"colorRedMinimum",   "colorRedMaximum",
                                                          "colorGreenMinimum", "colorGreenMaximum",
                                                          "colorBlueMinimum",  "colorBlueMaximum"};

/// Follows the elements by their names from the root and keeps what E57Scan has.
class ScanParser : public XmlEvents {
 public:
  ScanParser(E57Pages& pages, const E57Header& header) : XmlEvents(""), pages_(pages), header_(header) {}

  E57Scans parse() {
    constexpr std::uint64_t kStep = std::uint64_t{1} << 15;
    for (std::uint64_t done = 0; done < header_.xml_bytes && !ended_;) {
      const std::uint64_t n = std::min(kStep, header_.xml_bytes - done);
      feed(pages_.view(header_.xml_begin + done, static_cast<std::size_t>(n)));
      done += n;
    }
    if (!ended_) fail("it ends before its root element does");
    return std::move(found_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const override {
    pages_.fail(header_.xml_begin + std::min(offset(), header_.xml_bytes), "in the XML section: " + what);
  }

  bool in_scan() const { return names_.size() > 3 && in_data_; }
  /// The element at hand is `path`, its names from the scan on.
  bool at(std::initializer_list<std::string_view> path) const {
    return in_scan() && names_.size() == 3 + path.size() &&
           std::equal(path.begin(), path.end(), names_.begin() + 3);
  }
  /// It lies in `path`, at any depth.
  bool within(std::initializer_list<std::string_view> path) const {
    return in_scan() && names_.size() > 3 + path.size() &&
           std::equal(path.begin(), path.end(), names_.begin() + 3);
  }

  void start(std::string_view name, Attributes attributes) override {
    if (names_.size() == kDeepest) fail("elements are nested deeper than " + std::to_string(kDeepest));
    names_.emplace_back(name);
    text_.clear();
    if (names_.size() == 1 && names_[0] != "e57Root") fail("its root element is not e57Root");
    if (names_.size() == 2) in_data_ = names_[1] == "data3D";
    if (!in_data_) return;
    if (names_.size() == 3) {
      if (found_.count == kMaxScans) fail("more than 16384 scans in one file; split it");
      scan_ = {};
      scan_.number = ++found_.count;
    } else if (at({"points"})) {
      scan_.section = whole<std::uint64_t>(attributes, "fileOffset", 0);
      scan_.declared = whole<std::uint64_t>(attributes, "recordCount", 0);
    } else if (at({"pose"})) {
      scan_.has_pose = true;
    } else if (at({"sphericalBounds"})) {
      scan_.has_range_bounds = true;
    } else if (within({"points", "prototype"})) {
      const char* type = attribute(attributes, "type");
      if (!type) fail("element " + shown(names_.back()) + " of the prototype has no type");
      if (std::string_view(type) != "Structure" && std::string_view(type) != "Vector")
        field(type, attributes);
    } else if (within({"points", "codecs"}) && names_.size() == 7 && names_.back() != "inputs" &&
               names_.back() != "bitPackCodec") {
      fail("records in the code " + shown(names_.back()) + ", which is not known; bitPackCodec is");
    }
  }

  void end(std::string_view) override {
    if (at({"pose", "rotation", "w"})) number(scan_.rotation[0]);
    if (at({"pose", "rotation", "x"})) number(scan_.rotation[1]);
    if (at({"pose", "rotation", "y"})) number(scan_.rotation[2]);
    if (at({"pose", "rotation", "z"})) number(scan_.rotation[3]);
    if (at({"pose", "translation", "x"})) number(scan_.translation[0]);
    if (at({"pose", "translation", "y"})) number(scan_.translation[1]);
    if (at({"pose", "translation", "z"})) number(scan_.translation[2]);
    for (std::size_t i = 0; i < 6; ++i) {
      if (at({"cartesianBounds", kBoundNames[i]})) number(scan_.bounds[i]);
      if (at({"colorLimits", kColourNames[i]})) number(scan_.colour_limits[i]);
    }
    if (at({"intensityLimits", "intensityMinimum"})) number(scan_.intensity_limits[0]);
    if (at({"intensityLimits", "intensityMaximum"})) number(scan_.intensity_limits[1]);
    if (in_data_ && names_.size() == 3 && scan_.declared > 0) found_.scans.push_back(std::move(scan_));
    names_.pop_back();
    text_.clear();
    if (names_.size() == 1) in_data_ = false;
    ended_ = names_.empty();
    if (ended_) stop();  // some writers pad what follows
  }

  void text(std::string_view bytes) override { text_.append(bytes.substr(0, kLongestText - text_.size())); }

  /// The text of the element at hand; none stands for 0.
  void number(double& value) const {
    std::string_view text = text_;
    constexpr std::string_view kBlanks = " \t\r\n";
    text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
    value = 0;
    if (text.empty()) return;
    if (!take_number(text, value) || text.find_first_not_of(kBlanks) != std::string_view::npos)
      fail("element " + shown(names_.back()) + " is no number");
  }

  template <class T>
  T whole(Attributes attributes, std::string_view name, T otherwise) const {
    const char* text = attribute(attributes, name);
    if (!text) return otherwise;
    const char* const last = text + std::strlen(text);
    T value{};
    const auto [next, error] = std::from_chars(text, last, value);
    if (error != std::errc() || next != last) fail(not_a_number(name, text));
    return value;
  }
  double real(Attributes attributes, std::string_view name, double otherwise) const {
    const char* text = attribute(attributes, name);
    if (!text) return otherwise;
    std::string_view rest = text;
    double value = 0;
    if (!take_number(rest, value) || !rest.empty() || !std::isfinite(value)) fail(not_a_number(name, text));
    return value;
  }
  std::string not_a_number(std::string_view name, std::string_view text) const {
    return std::string(name) + "=\"" + std::string(text.substr(0, 40)) + "\" of element " +
           shown(names_.back()) + " is no number that can stand there";
  }
  static std::string shown(std::string_view name) { return "'" + std::string(name.substr(0, 40)) + "'"; }

  /// A terminal element of the prototype: the next bytestream. Those that nobody reads may have any type.
  void field(std::string_view type, Attributes attributes) {
    E57Field f;
    f.stream = scan_.streams++;
    const auto named = std::find_if(kUseNames.begin(), kUseNames.end(),
                                    [&](const UseName& u) { return u.name == names_.back(); });
    if (named == kUseNames.end() || names_.size() != 6) return;
    f.use = named->use;
    if (type == "Float") {
      const char* precision = attribute(attributes, "precision");
      const bool single = precision && std::string_view(precision) == "single";
      f.code = single ? E57Code::kSingle : E57Code::kDouble;
      f.bits = single ? 32 : 64;
      f.min_value = real(attributes, "minimum", 0.0);
      f.max_value = real(attributes, "maximum", 0.0);
    } else if (type == "Integer" || type == "ScaledInteger") {
      using Limits = std::numeric_limits<std::int64_t>;
      f.code = type == "Integer" ? E57Code::kInteger : E57Code::kScaled;
      f.minimum = whole<std::int64_t>(attributes, "minimum", Limits::min());
      f.maximum = whole<std::int64_t>(attributes, "maximum", Limits::max());
      if (f.maximum < f.minimum)
        fail("the minimum of element " + shown(names_.back()) + " is above its maximum");
      f.bits = static_cast<unsigned>(
          std::bit_width(static_cast<std::uint64_t>(f.maximum) - static_cast<std::uint64_t>(f.minimum)));
      if (f.code == E57Code::kScaled) {
        f.scale = real(attributes, "scale", 1.0);
        f.offset = real(attributes, "offset", 0.0);
      }
      f.min_value = static_cast<double>(f.minimum) * f.scale + f.offset;
      f.max_value = static_cast<double>(f.maximum) * f.scale + f.offset;
    } else {
      fail("element " + shown(names_.back()) + " of the prototype has type " + shown(type) +
           "; Float, Integer and ScaledInteger can be read");
    }
    if (scan_.find(named->use)) fail("element " + shown(names_.back()) + " is twice in the prototype");
    scan_.fields.push_back(f);
  }

  E57Pages& pages_;
  const E57Header& header_;
  E57Scans found_;
  E57Scan scan_;                    ///< the one at hand
  std::vector<std::string> names_;  ///< from the root to the element at hand
  std::string text_;                ///< of it, the beginning
  bool in_data_ = false;            ///< within data3D
  bool ended_ = false;              ///< the root element is complete
};

}  // namespace

E57Scan::E57Scan() {
  bounds.fill(std::numeric_limits<double>::quiet_NaN());
  colour_limits.fill(std::numeric_limits<double>::quiet_NaN());
  intensity_limits.fill(std::numeric_limits<double>::quiet_NaN());
}

const E57Field* E57Scan::find(E57Use use) const {
  const auto at = std::find_if(fields.begin(), fields.end(), [&](const E57Field& f) { return f.use == use; });
  return at == fields.end() ? nullptr : &*at;
}

E57Scans read_e57_scans(E57Pages& pages, const E57Header& header) {
  return ScanParser(pages, header).parse();
}

}  // namespace tessera
