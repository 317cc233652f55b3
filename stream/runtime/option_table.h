/// \file option_table.h
/// The options of a command, each named once. From its table come the command line with its help, the keys of a job
/// file, what job.json and the report say, and the rows of the README:
///
///     inline OptionTable option_table(FairOptions& o) {
///       OptionTable table("What it computes");
///       table.add("steps", &o.steps, "how often").within(1, 1000);
///       return table;
///     }
///
/// A table points into the object that it was made of; defaults are what the object holds then.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "octree/lattice.h"
#include "stream/files/json.h"

namespace tessera {

/// For values that only their command can read; never part of a job. A flag calls it once for every time it is given.
using OptionSetter = std::function<void(const std::string&)>;
using OptionField =
    std::variant<double*, int*, std::uint32_t*, std::uint64_t*, bool*, std::string*, std::filesystem::path*,
                 std::vector<std::string>*, Double3*, std::optional<Double3>*, std::vector<Double3>*>;

struct OptionRow {
  std::vector<std::string> names;  ///< without dashes; the first one is the key
  OptionField field;
  OptionSetter setter;  ///< called instead of writing the field, where there is one
  std::string help;
  std::string group;
  std::string placeholder;  ///< what stands for a value in the help; empty for flags
  std::vector<std::string> words;
  std::string word;         ///< of a number; empty: none
  double word_value = 0.0;  ///< what it stands for
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  bool is_flag = false;
  bool is_positional = false;
  bool is_hidden = false;
  bool is_bytes = false;
  bool splits = false;

  OptionRow& at_least(double value) { return minimum = value, *this; }
  OptionRow& within(double low, double high) { return minimum = low, maximum = high, *this; }
  OptionRow& one_of(std::vector<std::string> allowed);
  /// A number for which a word is typed and shown, whatever its bounds.
  OptionRow& or_word(std::string text, double value);
  OptionRow& shown_as(std::string text) { return placeholder = std::move(text), *this; }
  OptionRow& positional() { return is_positional = true, *this; }
  OptionRow& hidden() { return is_hidden = true, *this; }
  OptionRow& bytes() { return is_bytes = true, shown_as("SIZE"); }  ///< "2G", "512MiB"
  OptionRow& split() { return splits = true, *this; }               ///< a word with commas is a list of words

  /// "--threads", or the name alone
  std::string typed() const;
  bool is_list() const;
  /// What the field holds; empty where that says nothing: false, no text, no cap.
  std::string value_text() const;
  Json value_json() const;
  /// Reads what was typed. \throws UsageError naming the option, the value and what is possible
  void set(const std::vector<std::string>& typed_words) const;
};

class OptionTable {
 public:
  explicit OptionTable(std::string group = "");
  // Not inline: every stage makes a table, and would compile them again.
  OptionTable(const OptionTable& other);
  OptionTable(OptionTable&& other) noexcept;
  OptionTable& operator=(const OptionTable& other);
  OptionTable& operator=(OptionTable&& other) noexcept;
  ~OptionTable();

  /// \param names  "threads,t": the key, `--threads`, and other names; those of one letter have one dash
  OptionRow& add(const std::string& names, OptionField field, const std::string& help);
  OptionRow& add(const std::string& names, OptionSetter setter, const std::string& help);
  OptionRow& add_flag(const std::string& names, std::function<void()> given, const std::string& help);
  void append(const OptionTable& more);

  const std::vector<OptionRow>& rows() const { return rows_; }
  /// By any of its names; nullptr if there is none.
  const OptionRow* find(const std::string& name) const;

  /// Values by key; null for what is not set.
  Json to_json() const;
  /// Reads values by key, written as to_json() does or as they are typed. A list of numbers is one vector, a list of
  /// strings or of lists an option given more than once.
  /// \param keep  rows that stay as they are
  /// \throws UsageError for an unknown key (with the nearest one) or a value that makes no sense
  void from_json(const Json& values, const std::function<bool(const OptionRow&)>& keep = {}) const;

  /// Rows of a table in Markdown: option, default, meaning.
  std::string markdown() const;

 private:
  std::string group_;
  std::vector<OptionRow> rows_;
};

/// Numbers with commas and nothing else between them; empty unless there are `count`, all finite.
std::vector<double> numbers_of(const std::string& text, std::size_t count);

/// ", did you mean X?" if something known is near to the word, else nothing.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& known);

std::string table_text(const OptionTable& table);
void read_table_text(const OptionTable& table, const std::string& text);

/// Options as JobState::settings has them, and back. \throws UsageError for unknown keys and wrong values
template <class Options>
std::string to_settings(Options options) {
  return table_text(option_table(options));
}
template <class Options>
Options from_settings(const std::string& settings) {
  Options options;
  read_table_text(option_table(options), settings);
  return options;
}

}  // namespace tessera
