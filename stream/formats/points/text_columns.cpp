#include "stream/formats/points/text_columns.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "stream/formats/line_reader.h"

namespace tessera {

namespace {

struct Alias {
  std::string_view name;
  TextColumn column;
};
constexpr std::array kAliases = {
    Alias{"x", TextColumn::kX},
    Alias{"y", TextColumn::kY},
    Alias{"z", TextColumn::kZ},
    Alias{"nx", TextColumn::kNx},
    Alias{"ny", TextColumn::kNy},
    Alias{"nz", TextColumn::kNz},
    Alias{"normal_x", TextColumn::kNx},
    Alias{"normal_y", TextColumn::kNy},
    Alias{"normal_z", TextColumn::kNz},
    Alias{"normalx", TextColumn::kNx},
    Alias{"normaly", TextColumn::kNy},
    Alias{"normalz", TextColumn::kNz},
    Alias{"r", TextColumn::kRed},
    Alias{"g", TextColumn::kGreen},
    Alias{"b", TextColumn::kBlue},
    Alias{"red", TextColumn::kRed},
    Alias{"green", TextColumn::kGreen},
    Alias{"blue", TextColumn::kBlue},
    Alias{"intensity", TextColumn::kIntensity},
    Alias{"i", TextColumn::kIntensity},
    Alias{"scalar_intensity", TextColumn::kIntensity},
    Alias{"reflectance", TextColumn::kIntensity},
};

constexpr std::string_view kBlanks = " \t\r";

std::string_view trim(std::string_view text, std::string_view what) {
  const std::size_t begin = text.find_first_not_of(what);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(what) - begin + 1);
}

}  // namespace

TextColumn text_column(std::string_view name) {
  name = trim(name, " \t\r\"'");
  name = trim(name.substr(0, name.find_first_of("([")), " \t");
  std::string lower(name);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  for (const Alias& a : kAliases) {
    if (a.name == lower) return a.column;
  }
  return TextColumn::kOther;
}

std::string_view text_column_name(TextColumn column) {
  constexpr std::array<std::string_view, 11> kNames = {"x", "y", "z", "nx",        "ny", "nz",
                                                       "r", "g", "b", "intensity", "_"};
  return kNames[static_cast<std::size_t>(column)];
}

TextColumns::TextColumns(std::vector<TextColumn> columns) : columns_(std::move(columns)) {
  at_.fill(-1);
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    int& at = at_[static_cast<std::size_t>(columns_[i])];
    if (at >= 0 && columns_[i] != TextColumn::kOther && repeated_ == TextColumn::kOther)
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
