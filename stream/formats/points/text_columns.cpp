#include "stream/formats/points/text_columns.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "stream/formats/line_reader.h"

namespace tessera {

namespace {

/// What a name means, and how plainly: of several names for one value the plainest counts.
struct Alias {
  std::string_view name;
  TextColumn column;
  int rank = 0;
  bool degrees = false;  ///< longitude or latitude
  bool unit = false;     ///< colours of 0..1
};
constexpr std::array kAliases = {
    Alias{"x", TextColumn::kX},
    Alias{"y", TextColumn::kY},
    Alias{"z", TextColumn::kZ},
    Alias{"nx", TextColumn::kNx},
    Alias{"ny", TextColumn::kNy},
    Alias{"nz", TextColumn::kNz},
    Alias{"normal_x", TextColumn::kNx, 1},
    Alias{"normal_y", TextColumn::kNy, 1},
    Alias{"normal_z", TextColumn::kNz, 1},
    Alias{"normalx", TextColumn::kNx, 1},
    Alias{"normaly", TextColumn::kNy, 1},
    Alias{"normalz", TextColumn::kNz, 1},
    Alias{"r", TextColumn::kRed},
    Alias{"g", TextColumn::kGreen},
    Alias{"b", TextColumn::kBlue},
    Alias{"red", TextColumn::kRed},
    Alias{"green", TextColumn::kGreen},
    Alias{"blue", TextColumn::kBlue},
    Alias{"rf", TextColumn::kRed, 1, false, true},
    Alias{"gf", TextColumn::kGreen, 1, false, true},
    Alias{"bf", TextColumn::kBlue, 1, false, true},
    Alias{"diffuse_red", TextColumn::kRed, 2},
    Alias{"diffuse_green", TextColumn::kGreen, 2},
    Alias{"diffuse_blue", TextColumn::kBlue, 2},
    Alias{"intensity", TextColumn::kIntensity},
    Alias{"i", TextColumn::kIntensity, 1},
    Alias{"scalar_intensity", TextColumn::kIntensity, 2},
    Alias{"reflectance", TextColumn::kIntensity, 3},
    Alias{"easting", TextColumn::kX, 1},
    Alias{"northing", TextColumn::kY, 1},
    Alias{"elevation", TextColumn::kZ, 1},
    Alias{"height", TextColumn::kZ, 2},
    Alias{"altitude", TextColumn::kZ, 3},
    Alias{"east", TextColumn::kX, 2},
    Alias{"north", TextColumn::kY, 2},
    Alias{"up", TextColumn::kZ, 4},
    Alias{"elev", TextColumn::kZ, 5},
    Alias{"alt", TextColumn::kZ, 6},
    Alias{"point_x", TextColumn::kX, 3},
    Alias{"point_y", TextColumn::kY, 3},
    Alias{"point_z", TextColumn::kZ, 7},
    Alias{"e", TextColumn::kX, 4},
    Alias{"n", TextColumn::kY, 4},
    Alias{"h", TextColumn::kZ, 8},
    Alias{"u", TextColumn::kZ, 9},
    Alias{"longitude", TextColumn::kX, 5, true},
    Alias{"latitude", TextColumn::kY, 5, true},
    Alias{"long", TextColumn::kX, 6, true},
    Alias{"lon", TextColumn::kX, 7, true},
    Alias{"lng", TextColumn::kX, 8, true},
    Alias{"lat", TextColumn::kY, 6, true},
};
/// Names of columns that the user does not want.
constexpr std::array<std::string_view, 5> kSkipped = {"_", "skip", "ignore", "none", "-"};

constexpr std::string_view kBlanks = " \t\r";

std::string_view trim(std::string_view text, std::string_view what) {
  const std::size_t begin = text.find_first_not_of(what);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(what) - begin + 1);
}

std::string bare_name(std::string_view name) {
  name = trim(name, " \t\r\"'");
  name = trim(name.substr(0, name.find_first_of("([")), " \t");
  std::string lower(name);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return lower;
}

const Alias* alias_of(std::string_view name) {
  const std::string bare = bare_name(name);
  const auto* at =
      std::find_if(kAliases.begin(), kAliases.end(), [&](const Alias& a) { return a.name == bare; });
  return at == kAliases.end() ? nullptr : at;
}

/// A number with one comma among its digits, and nothing else that is none.
bool is_decimal_comma(std::string_view field) {
  if (!field.empty() && (field[0] == '-' || field[0] == '+')) field.remove_prefix(1);
  const std::size_t comma = field.find(',');
  if (comma == std::string_view::npos || comma + 1 == field.size()) return false;
  const auto digits = [](std::string_view text) {
    return text.find_first_not_of("0123456789") == std::string_view::npos;
  };
  const std::string_view fraction = field.substr(comma + 1);
  const std::size_t e = fraction.find_first_of("eEdD");
  std::string_view exponent = e == std::string_view::npos ? std::string_view("0") : fraction.substr(e + 1);
  if (!exponent.empty() && (exponent[0] == '-' || exponent[0] == '+')) exponent.remove_prefix(1);
  return digits(field.substr(0, comma)) && digits(fraction.substr(0, e)) && !exponent.empty() &&
         digits(exponent);
}

}  // namespace

TextColumn text_column(std::string_view name) {
  const Alias* alias = alias_of(name);
  return alias ? alias->column : TextColumn::kOther;
}

std::string_view text_column_name(TextColumn column) {
  constexpr std::array<std::string_view, 11> kNames = {"x", "y", "z", "nx",        "ny", "nz",
                                                       "r", "g", "b", "intensity", "_"};
  return kNames[static_cast<std::size_t>(column)];
}

std::string_view TextDialect::plain(std::string_view line, std::string& buffer) const {
  if (!decimal_comma) return line;
  buffer.assign(line);
  bool quoted = false;
  for (char& c : buffer) {
    if (c == '"') quoted = !quoted;
    if (c == ',' && (quoted || delimiter != ',')) c = '.';
  }
  return buffer;
}

void TextDialectVote::add(std::string_view line) {
  if (line.find(',') == std::string_view::npos) {
    // A point among digits: decimal.
    for (std::size_t at = line.find('.'); at != std::string_view::npos && other_ == 0;
         at = line.find('.', at + 1))
      other_ += at > 0 && line[at - 1] >= '0' && line[at - 1] <= '9' ? 1 : 0;
    return;
  }
  const bool quoted = line.find('"') != std::string_view::npos;
  const bool wide = line.find_first_of(";\t") == std::string_view::npos;  // white space alone between fields
  const char delimiter = line.find(';') != std::string_view::npos    ? ';'
                         : line.find('\t') != std::string_view::npos ? '\t'
                         : quoted                                    ? ','
                                                                     : ' ';
  std::size_t fields = 0;
  std::size_t decimal = 0;
  std::string_view field;
  const auto look = [&] {
    ++fields;
    if (is_decimal_comma(field)) {
      ++decimal;
      return;
    }
    double value = 0;
    std::string_view rest = field;
    const bool number = next_number(rest, value);
    const bool pointed =
        number && field.substr(0, field.size() - rest.size()).find('.') != std::string_view::npos;
    other_ += pointed || (number && field.find(',') != std::string_view::npos) ? 1 : 0;
  };
  if (delimiter == ' ') {
    for (std::size_t at = line.find_first_not_of(kBlanks); at != std::string_view::npos;) {
      const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
      field = line.substr(at, end - at);
      look();
      at = line.find_first_not_of(kBlanks, end);
    }
  } else {
    while (next_field(line, delimiter, field)) look();
  }
  if (decimal > 0 && wide && !quoted && fields < 3)
    ++other_;
  else
    decimal_ += decimal;
}

TextDialect TextDialectVote::decide(std::string_view first) const {
  TextDialect dialect;
  dialect.decimal_comma = decimal_ > 0 && other_ == 0;
  if (!dialect.decimal_comma) return {text_delimiter(first), false};
  // Commas that are decimal separate nothing; those between quoted fields do.
  const bool commas = first.find("\",") != std::string_view::npos;
  std::string buffer;
  dialect.delimiter = commas ? ',' : text_delimiter(dialect.plain(first, buffer));
  return dialect;
}

TextColumns TextColumns::named(const std::vector<std::string>& names) {
  std::array<int, 11> best;
  best.fill(99);
  std::vector<const Alias*> aliases;
  for (const std::string& name : names) {
    const Alias* a = alias_of(name);
    aliases.push_back(a);
    if (a)
      best[static_cast<std::size_t>(a->column)] =
          std::min(best[static_cast<std::size_t>(a->column)], a->rank);
  }
  std::vector<TextColumn> columns;
  bool degrees = true;
  bool unit = true;
  for (const Alias*& a : aliases) {
    if (a && a->rank > best[static_cast<std::size_t>(a->column)]) a = nullptr;
    columns.push_back(a ? a->column : TextColumn::kOther);
    if (a && a->column <= TextColumn::kY) degrees = degrees && a->degrees;
    if (a && a->column >= TextColumn::kRed && a->column <= TextColumn::kBlue) unit = unit && a->unit;
  }
  TextColumns named(std::move(columns));
  named.names_ = names;
  named.geographic_ = named.positions() && degrees;
  named.unit_colours_ = named.colours() && unit;
  return named;
}

bool TextColumns::all_known() const {
  return std::find(columns_.begin(), columns_.end(), TextColumn::kOther) == columns_.end();
}

std::vector<std::string> TextColumns::left_out() const {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (columns_[i] != TextColumn::kOther) continue;
    if (names_.empty()) {
      out.push_back("column " + std::to_string(i + 1));
    } else {
      const std::string name(trim(names_[i], " \t\r\"'"));
      if (std::find(kSkipped.begin(), kSkipped.end(), bare_name(name)) == kSkipped.end()) out.push_back(name);
    }
  }
  return out;
}

bool TextColumns::has_pointed_colours(std::string_view line, char delimiter) const {
  std::string_view field;
  for (std::size_t i = 0; i < needed_; ++i) {
    if (delimiter == ' ') {
      line.remove_prefix(std::min(line.find_first_not_of(" \t,;\r"), line.size()));
      field = line;
      if (!skip_field(line)) return false;
      field.remove_suffix(line.size());
    } else if (!next_field(line, delimiter, field)) {
      return false;
    }
    if (columns_[i] >= TextColumn::kRed && columns_[i] <= TextColumn::kBlue &&
        field.find_first_of(".eEdD") != std::string_view::npos)
      return true;
  }
  return false;
}

TextColumns::TextColumns(std::vector<TextColumn> columns) : columns_(std::move(columns)) {
  at_.fill(-1);
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    int& at = at_[static_cast<std::size_t>(columns_[i])];
    if (at >= 0 && columns_[i] < TextColumn::kIntensity && repeated_ == TextColumn::kOther)
      repeated_ = columns_[i];
    if (at < 0) at = static_cast<int>(i);
  }
  // Half a normal or colour is none.
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    TextColumn& c = columns_[i];
    const bool normal = c >= TextColumn::kNx && c <= TextColumn::kNz;
    const bool colour = c >= TextColumn::kRed && c <= TextColumn::kBlue;
    if ((normal && !normals()) || (colour && !colours())) c = TextColumn::kOther;
    if (static_cast<std::size_t>(c) < kTextSlots) needed_ = i + 1;
  }
}

std::string TextColumns::names() const {
  std::string text;
  for (const TextColumn c : columns_) {
    if (!text.empty()) text += ' ';
    text += text_column_name(c);
  }
  return text;
}

bool TextColumns::parse(std::string_view line, char delimiter, std::array<double, kTextSlots>& values) const {
  std::string_view field;
  for (std::size_t i = 0; i < needed_; ++i) {
    const auto slot = static_cast<std::size_t>(columns_[i]);
    const bool needed = slot < kTextSlots;
    if (delimiter == ' ') {
      if (!(needed ? next_number(line, values[slot]) : skip_field(line))) return false;
    } else {
      if (!next_field(line, delimiter, field)) return false;
      if (!needed) continue;
      if (field.empty()) {
        values[slot] = std::numeric_limits<double>::quiet_NaN();
      } else if (!next_number(field, values[slot]) || !is_blank(field)) {
        return false;
      }
    }
  }
  return true;
}

char text_delimiter(std::string_view line) {
  for (const char c : {';', ',', '\t'}) {
    if (line.find(c) == std::string_view::npos) continue;
    // Two numbers in one field: the separator does not stand between all of them, as in "1 2 3, 10 20 30".
    std::string_view field;
    bool apart = true;
    double value = 0;
    while (next_field(line, c, field)) {
      const bool number = next_number(field, value);
      apart = apart && !(number && !field.empty() && (field[0] == ' ' || field[0] == '\t'));
    }
    return apart ? c : ' ';
  }
  return ' ';
}

bool next_field(std::string_view& line, char delimiter, std::string_view& field) {
  if (line.data() == nullptr) return false;
  std::size_t end;
  const std::size_t begin = line.find_first_not_of(" \r");
  if (begin != std::string_view::npos && line[begin] == '"') {
    const std::size_t quote = line.find('"', begin + 1);
    end = quote == std::string_view::npos ? quote : line.find(delimiter, quote);
  } else {
    end = line.find(delimiter);
  }
  field = trim(trim(line.substr(0, end), delimiter == '\t' ? std::string_view(" \r") : kBlanks), "\"");
  // Past the last field the view becomes null, which an empty last field is not.
  line = end == std::string_view::npos ? std::string_view() : line.substr(end + 1);
  return true;
}

}  // namespace tessera
