#include "stream/formats/points/projection.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <sstream>
#include <utility>

#include "octree/error.h"
#include "stream/files/read_file.h"
#include "stream/formats/proj_library.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

constexpr double kGrain = 16384.0;  ///< steps of a unit, in results
constexpr std::size_t kRemembered = 1024;

/// What PROJ makes the system of.
std::string definition(const Crs& crs) {
  if (!crs.wkt.empty()) return crs.wkt;
  return crs.horizontal != 0 ? "EPSG:" + std::to_string(crs.horizontal) : "";
}

/// What of a system is in the plane; null where PROJ cannot read it.
ProjHandle horizontal_of(PJ_CONTEXT* context, const Crs& crs) {
  const std::string text = definition(crs);
  ProjHandle all(text.empty() ? nullptr : proj().create(context, text.c_str()));
  for (int depth = 0; all && depth < 4; ++depth) {
    const PJ_TYPE type = proj().get_type(all.get());
    if (type == PJ_TYPE_COMPOUND_CRS)
      all.reset(proj().crs_get_sub_crs(context, all.get(), 0));
    else if (type == PJ_TYPE_BOUND_CRS)
      all.reset(proj().get_source_crs(context, all.get()));
    else
      break;
  }
  return all;
}

bool is_geographic(PJ_TYPE type) {
  return type == PJ_TYPE_GEOGRAPHIC_2D_CRS || type == PJ_TYPE_GEOGRAPHIC_3D_CRS;
}

/// Metres of a projected system's unit; 0 for others.
double unit_of(PJ_CONTEXT* context, const PJ* crs) {
  if (crs == nullptr || proj().get_type(crs) != PJ_TYPE_PROJECTED_CRS) return 0.0;
  const ProjHandle axes(proj().crs_get_coordinate_system(context, crs));
  double metres = 0.0;
  if (!axes || proj().cs_get_axis_info(context, axes.get(), 0, nullptr, nullptr, nullptr, &metres, nullptr,
                                       nullptr, nullptr) == 0)
    return 0.0;
  return metres;
}

/// Parameters of a PROJ string, sorted: "+proj=utm +zone=32" as {"proj", "utm"}, {"zone", "32"}.
std::map<std::string, std::string> parameters_of(const char* text) {
  std::map<std::string, std::string> parameters;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::size_t equal = word.find('=');
    parameters[word.substr(0, equal)] = equal == std::string::npos ? "" : word.substr(equal + 1);
  }
  parameters.erase("+no_defs");
  parameters.erase("+type");
  return parameters;
}

/// Projection, parameters, ellipsoid or datum and units are equal, but for the last digits.
bool same_parameters(PJ_CONTEXT* context, const PJ* a, const PJ* b) {
  const char* first = proj().as_proj_string(context, a, PJ_PROJ_4, nullptr);
  const auto one = first ? parameters_of(first) : std::map<std::string, std::string>();
  const char* second = proj().as_proj_string(context, b, PJ_PROJ_4, nullptr);
  const auto other = second ? parameters_of(second) : std::map<std::string, std::string>();
  if (one.empty() || one.size() != other.size()) return false;
  return std::equal(one.begin(), one.end(), other.begin(), [](const auto& p, const auto& q) {
    if (p.first != q.first) return false;
    if (p.second == q.second) return true;
    std::string_view s = p.second, t = q.second;
    double u = 0.0, v = 0.0;
    return take_number(s, u) && s.empty() && take_number(t, v) && t.empty() &&
           std::abs(u - v) <= 1e-9 * std::max({1.0, std::abs(u), std::abs(v)});
  });
}

std::optional<bool> query_proj(const Crs& a, const Crs& b) {
  if (proj().library == nullptr) return std::nullopt;
  const ProjContext context = proj_context();
  const ProjHandle one = horizontal_of(context.get(), a);
  const ProjHandle other = horizontal_of(context.get(), b);
  if (!one || !other) return std::nullopt;
  if (proj().is_equivalent_to_with_ctx(context.get(), one.get(), other.get(),
                                       PJ_COMP_EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS) != 0)
    return true;
  // Names of datums differ between programs even where PROJ knows none of them for the other; of two codes it knows all.
  const bool codes = a.horizontal != 0 && b.horizontal != 0;
  return !codes && same_parameters(context.get(), one.get(), other.get());
}

}  // namespace

std::optional<bool> same_projection(const Crs& a, const Crs& b) {
  static std::mutex mutex;
  static std::map<std::pair<std::string, std::string>, std::optional<bool>> remembered;
  std::pair<std::string, std::string> both = {definition(a), definition(b)};
  if (both.first.empty() || both.second.empty()) return std::nullopt;
  if (both.second < both.first) std::swap(both.first, both.second);
  const std::lock_guard lock(mutex);
  const auto at = remembered.find(both);
  if (at != remembered.end()) return at->second;
  if (remembered.size() >= kRemembered) remembered.clear();
  return remembered[both] = query_proj(a, b);
}

bool is_same_crs(const Crs& a, const Crs& b) {
  if (may_be_same(a, b)) return true;
  if (a.vertical != 0 && b.vertical != 0 && a.vertical != b.vertical) return false;
  return same_projection(a, b).value_or(false);
}

double plane_unit(const Crs& crs) {
  if (proj().library == nullptr || !crs.known()) return 0.0;
  const ProjContext context = proj_context();
  const ProjHandle plane = horizontal_of(context.get(), crs);
  return unit_of(context.get(), plane.get());
}

Crs user_crs(const std::string& text, const std::string& option) {
  // PROJ would also take parts of names for the first system that has them.
  const std::size_t colon = text.find(':');
  const bool code = colon != std::string::npos && colon > 0 && colon + 1 < text.size() &&
                    std::all_of(text.begin(), text.end(), [](char c) {
                      return c == ':' || c == '_' || (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
                             (c >= 'a' && c <= 'z');
                    });
  const bool description =
      text.find('[') != std::string::npos || text.rfind("+proj=", 0) == 0 || text[0] == '{';
  if (proj().library == nullptr)
    throw UsageError(option + ": there is no libproj.so.25 to know coordinate systems by; install libproj25");
  const ProjContext context = proj_context();
  const ProjHandle crs(code || description ? proj().create(context.get(), text.c_str()) : nullptr);
  const PJ_TYPE type = crs ? proj().get_type(crs.get()) : PJ_TYPE_UNKNOWN;
  const bool known = is_geographic(type) || type == PJ_TYPE_PROJECTED_CRS || type == PJ_TYPE_COMPOUND_CRS ||
                     type == PJ_TYPE_BOUND_CRS || type == PJ_TYPE_ENGINEERING_CRS;
  const char* wkt = known ? proj().as_wkt(context.get(), crs.get(), PJ_WKT1_GDAL, nullptr) : nullptr;
  if (known && wkt == nullptr) wkt = proj().as_wkt(context.get(), crs.get(), PJ_WKT2_2019, nullptr);
  if (wkt == nullptr)
    throw UsageError(option + " " + text.substr(0, 80) +
                     ": is no coordinate system; it is EPSG:n, as EPSG:25832, or WKT");
  std::string flat;  // one line, as .prj files have it
  bool quoted = false;
  for (const char* c = wkt; *c != '\0'; ++c) {
    if (*c == '"') quoted = !quoted;
    if (quoted || !(*c == ' ' || (*c >= '\t' && *c <= '\r'))) flat += *c;
  }
  return crs_of_wkt(flat);
}

std::string crs_text(const std::string& text, const std::string& option) {
  std::error_code error;
  std::string crs = text;
  if (std::filesystem::is_regular_file(text, error)) {
    constexpr std::uint64_t kMax = std::uint64_t{1} << 20;
    const ReadFile file(text);
    crs.resize(static_cast<std::size_t>(std::min(file.size(), kMax)));
    file.read_at(0, crs.data(), crs.size());
    crs.erase(crs.find_last_not_of(" \t\r\n") + 1);  // editors end lines
  }
  user_crs(crs, option);
  return crs;
}

Crs utm_zone(const Crs& geographic, double longitude, double latitude) {
  if (!(latitude >= -80.0 && latitude <= 84.0 && longitude >= -360.0 && longitude <= 360.0))
    throw InputError(
        "--project auto: the middle of the scan, " + std::to_string(longitude) + " " +
        std::to_string(latitude) +
        ", is no longitude and latitude between 80 south and 84 north, where UTM zones are; name a "
        "system with --project EPSG:n");
  const double wrapped = longitude - 360.0 * std::floor((longitude + 180.0) / 360.0);
  const int zone = std::min(60, 1 + static_cast<int>(std::floor((wrapped + 180.0) / 6.0)));
  // Zones of other datums where EPSG has them: ETRS89, NAD83, NAD83(2011), GDA94, GDA2020.
  int code = (latitude < 0.0 ? 32700 : 32600) + zone;
  const int base = geographic.horizontal;
  if ((base == 4258 || base == 4937) && latitude >= 0.0 && zone >= 28 && zone <= 38) code = 25800 + zone;
  if (base == 4269 && latitude >= 0.0 && zone >= 1 && zone <= 23) code = 26900 + zone;
  if ((base == 6318 || base == 6319) && latitude >= 0.0 && zone >= 1 && zone <= 19) code = 6329 + zone;
  if ((base == 4283) && latitude < 0.0 && zone >= 48 && zone <= 58) code = 28300 + zone;
  if ((base == 7844 || base == 7843) && latitude < 0.0 && zone >= 46 && zone <= 59) code = 7800 + zone;
  return user_crs("EPSG:" + std::to_string(code), "--project auto");
}

struct Projection::Proj {
  ProjContext context;
  ProjHandle transformation;
};

Projection::Projection(const Crs& from, const Crs& to) : proj_(std::make_unique<Proj>()) {
  const auto refuse = [&] {
    throw InputError("no way is known from the coordinate system " + from.name + " to " + to.name +
                     (proj().library == nullptr ? ": install libproj25" : "; name another with --project"));
  };
  if (proj().library == nullptr) refuse();
  proj_->context = proj_context();
  PJ_CONTEXT* context = proj_->context.get();
  const ProjHandle source = horizontal_of(context, from);
  const ProjHandle target = horizontal_of(context, to);
  if (!source || !target) refuse();
  const ProjHandle raw(
      proj().create_crs_to_crs_from_pj(context, source.get(), target.get(), nullptr, nullptr));
  // Easting before northing and longitude before latitude, whatever order the axes have.
  if (raw) proj_->transformation.reset(proj().normalize_for_visualization(context, raw.get()));
  if (!proj_->transformation) refuse();
  const double source_unit = unit_of(context, source.get());
  const double target_unit = unit_of(context, target.get());
  const double heights = from.height_unit > 0.0 ? from.height_unit : source_unit > 0.0 ? source_unit : 1.0;
  if (target_unit > 0.0) height_scale_ = heights / target_unit;
}

Projection::~Projection() = default;

void Projection::apply(std::vector<double>& x, std::vector<double>& y, std::vector<double>& z) const {
  constexpr std::size_t kStep = sizeof(double);
  if (x.empty()) return;
  proj().trans_generic(proj_->transformation.get(), PJ_FWD, x.data(), kStep, x.size(), y.data(), kStep,
                       y.size(), nullptr, 0, 0, nullptr, 0, 0);
  const auto grain = [](double v) {
    return std::isfinite(v) ? std::nearbyint(v * kGrain) / kGrain : std::numeric_limits<double>::quiet_NaN();
  };
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = grain(x[i]);
    y[i] = grain(y[i]);
    if (height_scale_ != 1.0) z[i] *= height_scale_;
  }
}

}  // namespace tessera
