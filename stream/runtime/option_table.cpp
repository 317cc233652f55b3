#include "stream/runtime/option_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

std::vector<std::string> cut(const std::string& text) {
  std::vector<std::string> parts;
  std::stringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
}

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

/// Levenshtein distance.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row[b.size()];
}

/// The number that fills `text`; a sign of its own is no number of an unsigned type, NaN is none of any.
template <typename T>
std::optional<T> number(const std::string& text) {
  T value{};
  const char* begin = text.c_str() + (text.rfind('+', 0) == 0 ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.c_str() + text.size(), value);
  if (error != std::errc() || end != text.c_str() + text.size()) return std::nullopt;
  if constexpr (std::is_floating_point_v<T>)
    if (!std::isfinite(value)) return std::nullopt;
  return value;
}

/// Writes one value of a row into its field.
struct Reader {
  const OptionRow& row;
  const std::string& text;

  [[noreturn]] void refuse(const std::string& why) const {
    throw UsageError(fmt::format("{} {}: {}", row.typed(), text, why));
  }
  template <typename T>
  void operator()(T* field) const {
    const std::optional<T> value = number<T>(text);
    if (!value)
      refuse(!row.word.empty()             ? "is not " + row.word + " or a finite number"
             : std::is_floating_point_v<T> ? "is not a finite number"
             : std::is_unsigned_v<T>       ? "is not a whole number from 0 on"
                                           : "is not a whole number");
    const auto size = static_cast<double>(*value);
    if (size >= row.minimum && size <= row.maximum) {
      *field = *value;
    } else if (std::isfinite(row.maximum)) {
      refuse(fmt::format("must be {} to {}", number_text(row.minimum), number_text(row.maximum)));
    } else {
      refuse("must be at least " + number_text(row.minimum));
    }
  }
  void operator()(double* field) const {
    if (!row.word.empty() && text == row.word) {
      *field = row.word_value;
    } else {
      operator()<double>(field);
    }
  }
  void operator()(std::uint64_t* field) const {
    if (row.is_bytes) {
      *field = parse_bytes(text);
    } else {
      operator()<std::uint64_t>(field);
    }
  }
  void operator()(bool* field) const {
    if (text != "true" && text != "false") refuse("must be true or false");
    *field = text == "true";
  }
  void operator()(std::string* field) const {
    if (!row.words.empty() && std::find(row.words.begin(), row.words.end(), text) == row.words.end())
      refuse("not one of " + joined(row.words, ", ") + did_you_mean(text, row.words));
    *field = text;
  }
  void operator()(std::filesystem::path* field) const { *field = text; }
  void operator()(std::vector<std::string>* field) const {
    const std::vector<std::string> parts = row.splits ? cut(text) : std::vector{text};
    field->insert(field->end(), parts.begin(), parts.end());
  }
  Double3 vector() const {
    const std::vector<double> v = numbers_of(text, 3);
    if (v.empty()) refuse("is not x,y,z: write three numbers with commas and no spaces");
    return {v[0], v[1], v[2]};
  }
  void operator()(Double3* field) const { *field = vector(); }
  void operator()(std::optional<Double3>* field) const { *field = vector(); }
  void operator()(std::vector<Double3>* field) const { field->push_back(vector()); }
};

struct ToJson {
  template <typename T>
  Json operator()(const T* field) const {
    return *field;
  }
  Json operator()(const std::filesystem::path* field) const { return json_text(*field); }
  Json operator()(const std::string* field) const { return json_text(*field); }
  Json operator()(const std::vector<std::string>* field) const {
    Json list = Json::array();
    for (const std::string& text : *field) list.push_back(json_text(text));
    return list;
  }
  Json operator()(const std::optional<Double3>* field) const { return *field ? Json(**field) : Json(); }
};

/// The word that is typed for a JSON value.
std::string word_of(const std::string& key, const Json& value) {
  if (value.is_string()) return bytes_of_json_text(value.get<std::string>());
  if (value.is_boolean() || value.is_number()) return dump_json(value);
  std::vector<std::string> numbers;
  for (const Json& item : value.is_array() ? value : Json::array())
    if (item.is_number()) numbers.push_back(dump_json(item));
  if (value.empty() || numbers.size() != value.size())
    throw UsageError("the value of '" + key + "' must be a string, number, boolean or a list of these");
  return joined(numbers, ",");
}

std::vector<std::string> words_of(const std::string& key, const Json& value) {
  std::vector<std::string> words;
  if (value.is_array() && !value.empty() && !value.front().is_number()) {
    for (const Json& item : value) words.push_back(word_of(key, item));
  } else if (!value.is_null() && !(value.is_array() && value.empty())) {
    words.push_back(word_of(key, value));
  }
  return words;
}

}  // namespace

OptionRow& OptionRow::one_of(std::vector<std::string> allowed) {
  words = std::move(allowed);
  return shown_as(joined(words, "|"));
}

OptionRow& OptionRow::or_word(std::string text, double value) {
  word = std::move(text);
  word_value = value;
  return shown_as(word + "|X");
}

std::string OptionRow::typed() const {
  return (is_positional ? "" : "--") + names.front();
}

bool OptionRow::is_list() const {
  return std::holds_alternative<std::vector<std::string>*>(field) ||
         std::holds_alternative<std::vector<Double3>*>(field);
}

std::string OptionRow::value_text() const {
  if (is_flag || is_list()) return "";
  const Json value = value_json();
  if (value.is_string()) return value.get<std::string>();
  if (value.is_null() || value.is_array()) return "";
  if (is_bytes) return value == 0 ? "" : format_bytes(value.get<std::uint64_t>());
  return value.is_number_float() ? number_text(value.get<double>()) : dump_json(value);
}

Json OptionRow::value_json() const {
  if (setter) return nullptr;
  const auto* number = std::get_if<double*>(&field);
  if (number != nullptr && !word.empty() && **number == word_value) return word;
  return std::visit(ToJson{}, field);
}

void OptionRow::set(const std::vector<std::string>& typed_words) const {
  if (const auto* list = std::get_if<std::vector<std::string>*>(&field)) (*list)->clear();
  if (const auto* list = std::get_if<std::vector<Double3>*>(&field)) (*list)->clear();
  if (const auto* maybe = std::get_if<std::optional<Double3>*>(&field)) (*maybe)->reset();
  for (const std::string& text : typed_words) {
    const Reader read{*this, text};
    bool on = true;
    if (!setter)
      std::visit(read, field);
    else if (is_flag)
      read(&on);
    if (setter && on) setter(text);
  }
}

OptionTable::OptionTable(std::string group) : group_(std::move(group)) {}
OptionTable::OptionTable(const OptionTable& other) = default;
OptionTable::OptionTable(OptionTable&& other) noexcept = default;
OptionTable& OptionTable::operator=(const OptionTable& other) = default;
OptionTable& OptionTable::operator=(OptionTable&& other) noexcept = default;
OptionTable::~OptionTable() = default;

OptionRow& OptionTable::add(const std::string& names, OptionField field, const std::string& help) {
  static constexpr const char* kPlaceholders[] = {"X",    "N",    "N",     "N",     "",     "WORD",
                                                  "PATH", "WORD", "X,Y,Z", "X,Y,Z", "X,Y,Z"};
  static_assert(std::size(kPlaceholders) == std::variant_size_v<OptionField>);
  OptionRow row;
  row.names = cut(names);
  row.help = help;
  row.group = group_;
  row.placeholder = kPlaceholders[field.index()];
  row.is_flag = std::holds_alternative<bool*>(field);
  row.field = field;
  return rows_.emplace_back(std::move(row));
}

OptionRow& OptionTable::add(const std::string& names, OptionSetter setter, const std::string& help) {
  OptionRow& row = add(names, OptionField(), help);
  row.setter = std::move(setter);
  return row.shown_as("TEXT");
}

OptionRow& OptionTable::add_flag(const std::string& names, std::function<void()> given,
                                 const std::string& help) {
  OptionRow& row =
      add(names, OptionSetter([given = std::move(given)](const std::string&) { given(); }), help);
  row.is_flag = true;
  return row.shown_as("");
}

void OptionTable::append(const OptionTable& more) {
  rows_.insert(rows_.end(), more.rows_.begin(), more.rows_.end());
}

const OptionRow* OptionTable::find(const std::string& name) const {
  for (const OptionRow& row : rows_)
    if (std::find(row.names.begin(), row.names.end(), name) != row.names.end()) return &row;
  return nullptr;
}

Json OptionTable::to_json() const {
  Json values = Json::object();
  for (const OptionRow& row : rows_)
    if (!row.setter) values[row.names.front()] = row.value_json();
  return values;
}

void OptionTable::from_json(const Json& values, const std::function<bool(const OptionRow&)>& keep) const {
  for (const auto& [key, value] : values.items()) {
    const OptionRow* row = find(key);
    if (row == nullptr) {
      std::vector<std::string> known;
      for (const OptionRow& r : rows_) known.push_back(r.typed());
      throw UsageError(fmt::format("unknown key '{}'{}", key, did_you_mean("--" + key, known)));
    }
    if (!keep || !keep(*row)) row->set(words_of(key, value));
  }
}

std::string OptionTable::markdown() const {
  const auto cell = [](std::string text) {  // a bar would end it
    for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2)
      text.insert(at, 1, '\\');
    return text;
  };
  std::string text = "| option | default | meaning |\n|---|---|---|\n";
  for (const OptionRow& row : rows_) {
    if (row.is_hidden || row.is_positional) continue;
    text += fmt::format("| `{}{}{}` | {} | {} |\n", row.typed(), row.placeholder.empty() ? "" : " ",
                        cell(row.placeholder), row.value_text(), cell(row.help));
  }
  return text;
}

std::vector<double> numbers_of(const std::string& text, std::size_t count) {
  std::vector<double> values;
  for (const std::string& part : cut(text)) {
    const std::optional<double> value = number<double>(part);
    if (!value) return {};
    values.push_back(*value);
  }
  return values.size() == count ? values : std::vector<double>{};
}

std::string did_you_mean(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    // What was typed may be a beginning ("--res"): as good as one slip.
    const bool begins = word.size() > 3 && candidate.rfind(word, 0) == 0;
    const std::size_t distance = begins ? 1 : edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best.empty() ? "" : fmt::format(", did you mean {}?", best);
}

std::string table_text(const OptionTable& table) {
  return dump_json(table.to_json());
}

void read_table_text(const OptionTable& table, const std::string& text) {
  table.from_json(parse_json(text));
}

}  // namespace tessera
