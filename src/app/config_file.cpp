#include "app/config_file.h"

#include <fcntl.h>
#include <toml++/toml.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <map>
#include <utility>

#include "app/parameter_text.h"
#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {
namespace {

using Row = Parameter<DaemonConfig>;

constexpr std::size_t kLargestFile = 1 << 20;

std::string_view section_of(std::string_view key) { return key.substr(0, key.find('.')); }
std::string_view name_of(std::string_view key) { return key.substr(key.find('.') + 1); }

const Row* find_row(std::string_view key) {
  for (const Row& row : daemon_parameters())
    if (row.key == key) return &row;
  return nullptr;
}

bool is_section(std::string_view name) {
  return std::ranges::any_of(daemon_parameters(),
                             [name](const Row& row) { return section_of(row.key) == name; });
}

std::string unknown_key(std::string_view key) {
  std::vector<std::string_view> keys;
  for (const Row& row : daemon_parameters()) keys.push_back(row.key);
  std::string text = "there is no parameter " + std::string(key);
  if (const auto nearest = nearest_name(key, keys))
    text += "; did you mean " + std::string(*nearest) + "?";
  return text;
}

std::string unknown_section(std::string_view name) {
  std::vector<std::string_view> sections;
  for (const Row& row : daemon_parameters())
    if (sections.empty() || sections.back() != section_of(row.key))
      sections.push_back(section_of(row.key));
  std::string text = "there is no section [" + std::string(name) + "]";
  if (const auto nearest = nearest_name(name, sections))
    text += "; did you mean [" + std::string(*nearest) + "]?";
  return text;
}

std::string_view kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a section";
    case toml::node_type::array:
      return "a list";
    case toml::node_type::string:
      return "text";
    case toml::node_type::integer:
      return "a whole number";
    case toml::node_type::floating_point:
      return "a number with a fraction";
    case toml::node_type::boolean:
      return "true or false";
    default:
      return "a date or time";
  }
}

std::optional<int> int_of(const toml::node& node) {
  const auto* const integer = node.as_integer();
  if (integer == nullptr) return std::nullopt;
  const std::int64_t value = integer->get();
  if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
    return std::nullopt;
  return static_cast<int>(value);
}

/// Puts the node's value where a parameter's value lives; false if it is of another type.
struct Assign {
  const toml::node& node;

  template <class T>
  bool put(T* target, const std::optional<T>& value) const {
    if (value) *target = *value;
    return value.has_value();
  }
  bool operator()(bool* target) const { return put(target, node.value_exact<bool>()); }
  bool operator()(int* target) const { return put(target, int_of(node)); }
  bool operator()(double* target) const {
    if (const auto* const integer = node.as_integer())  // 3 is as good as 3.0
      return put(target, std::optional(static_cast<double>(integer->get())));
    return put(target, node.value_exact<double>());
  }
  bool operator()(std::string* target) const {
    return put(target, node.value_exact<std::string>());
  }
  bool operator()(std::vector<int>* target) const {
    const toml::array* const array = node.as_array();
    if (array == nullptr) return false;
    std::vector<int> values;
    for (const toml::node& element : *array) {
      const std::optional<int> value = int_of(element);
      if (!value) return false;
      values.push_back(*value);
    }
    return put(target, std::optional(std::move(values)));
  }
};

/// One mistake and where it is, to be put in order at the end.
struct Mistake {
  std::size_t order = 0;  ///< line of the file; --set comes after all lines
  std::string text;
};

constexpr std::size_t kOrderOfSets = std::numeric_limits<std::size_t>::max() - 1;
constexpr std::size_t kOrderOfRules = std::numeric_limits<std::size_t>::max();

/// Where the value of a key came from.
struct Origin {
  std::size_t order = kOrderOfRules;
  std::string place;
};

/// Collects the values and mistakes of a file and of --set, in that order.
class Loader {
 public:
  void add_file(std::string_view text, std::string_view place) {
    try {
      const toml::table table = toml::parse(text, place);
      for (const auto& [name, node] : table) add_section(name.str(), node, place);
    } catch (const toml::parse_error& error) {
      const auto at = error.source().begin;
      add_mistake({at.line, std::string(place) + ":" + std::to_string(at.line) + ":" +
                                std::to_string(at.column) + ": "},
                  std::string("syntax: ") + std::string(error.description()));
    }
  }

  void add_set(const std::string& set) {
    const Origin origin{kOrderOfSets, "--set: "};
    const std::size_t equals = set.find('=');
    if (equals == std::string::npos)
      return add_mistake(origin, toml_string(set) + " is not of the form key=value");
    const std::string key = set.substr(0, equals);
    const Row* const row = find_row(key);
    if (row == nullptr) return add_mistake(origin, unknown_key(key));
    add_set_value(*row, set.substr(equals + 1), origin);
  }

  void add_mistake(const Origin& origin, const std::string& text) {
    mistakes_.push_back({origin.order, origin.place + text});
  }

  /// Validates what was read and returns it with all mistakes, in order of place.
  LoadedConfig finish() {
    for (const std::string& violation : validate(config_)) {
      const auto origin = origins_.find(violation.substr(0, violation.find(' ')));
      add_mistake(origin == origins_.end() ? Origin{} : origin->second, violation);
    }
    std::ranges::stable_sort(mistakes_, {}, &Mistake::order);
    LoadedConfig loaded{config_, {}};
    for (Mistake& mistake : mistakes_) loaded.mistakes.push_back(std::move(mistake.text));
    return loaded;
  }

 private:
  void add_section(std::string_view section, const toml::node& node, std::string_view place) {
    const Origin origin = origin_of(node, place);
    const toml::table* const table = node.as_table();
    if (table == nullptr) return add_mistake(origin, unknown_key(section));
    if (!is_section(section)) return add_mistake(origin, unknown_section(section));
    for (const auto& [name, value] : *table) {
      const std::string key = std::string(section) + "." + std::string(name.str());
      const Row* const row = find_row(key);
      if (row == nullptr)
        add_mistake(origin_of(value, place), unknown_key(key));
      else
        assign(*row, value, origin_of(value, place));
    }
  }

  void assign(const Row& row, const toml::node& node, const Origin& origin) {
    const ParameterRef ref = row.ref(config_);
    if (std::visit(Assign{node}, ref)) {
      origins_.insert_or_assign(std::string(row.key), origin);
      return;
    }
    if (node.is_integer() && std::holds_alternative<int*>(ref))  // does not even fit an int
      return add_mistake(origin, out_of_int(row, node.as_integer()->get()));
    add_mistake(origin, std::string(row.key) + " expects " + std::string(type_name(ref)) +
                            ", not " + std::string(kind_of(node)));
  }

  static std::string out_of_int(const Row& row, std::int64_t value) {
    const std::string key(row.key);
    return key + " = " + std::to_string(value) + ". Violated constraint: " + key +
           (value < 0 ? " >= " + number_text(row.min) : " <= " + number_text(row.max));
  }

  /// Text stands for itself unless it is in quotes; a list may come without its brackets.
  void add_set_value(const Row& row, std::string value, const Origin& origin) {
    const ParameterRef ref = row.ref(config_);
    const bool quoted = value.starts_with('"') || value.starts_with('\'');
    if (std::holds_alternative<std::string*>(ref) && !quoted) value = toml_string(value);
    if (std::holds_alternative<std::vector<int>*>(ref) && !value.starts_with('['))
      value = "[" + value + "]";
    const std::string key(row.key);
    try {
      const toml::table table = toml::parse("value = " + value);
      const toml::node* const node = table.get("value");
      if (table.size() == 1 && node != nullptr) return assign(row, *node, origin);
    } catch (const toml::parse_error&) {
      // not a value of any type: said below
    }
    add_mistake(origin,
                key + " expects " + std::string(type_name(ref)) + ", not " + toml_string(value));
  }

  static Origin origin_of(const toml::node& node, std::string_view place) {
    const std::size_t line = node.source().begin.line;
    return {line, std::string(place) + ":" + std::to_string(line) + ": "};
  }

  DaemonConfig config_;
  std::map<std::string, Origin> origins_;
  std::vector<Mistake> mistakes_;
};

Result<std::string> read_file(const std::string& path) {
  const std::string what = "cannot read the config file " + path;
  const UniqueFd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return errno_error(what, errno);
  std::string text(kLargestFile + 1, '\0');
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t count = read(fd.get(), text.data() + size, text.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno_error(what, errno);
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
  }
  if (size > kLargestFile) return Error{what + ": it has more than 1 MiB", EFBIG};
  text.resize(size);
  return text;
}

/// `text` as comment lines of at most 100 columns.
void append_comment(std::string& out, std::string_view text) {
  constexpr std::size_t kColumns = 98;
  while (!text.empty()) {
    std::size_t end = text.size();
    if (end > kColumns) {
      const std::size_t blank = text.rfind(' ', kColumns);
      end = blank == std::string_view::npos ? kColumns : blank;
    }
    out.append("# ").append(text.substr(0, end)).append("\n");
    text.remove_prefix(std::min(text.size(), end + 1));
  }
}

std::string unit_and_range(const Row& row, const ParameterRef& ref) {
  const std::string range = range_text(ref, row.min, row.max);
  return "(" + range + (row.unit.empty() ? "" : " ") + std::string(row.unit) + ")";
}

}  // namespace

LoadedConfig load_config(const std::optional<std::string>& path,
                         std::span<const std::string> sets) {
  if (!path) return parse_config("", "", sets);
  const Result<std::string> text = read_file(*path);
  if (text) return parse_config(text.value(), *path, sets);
  LoadedConfig loaded = parse_config("", "", sets);
  loaded.mistakes.insert(loaded.mistakes.begin(), text.error().message);
  return loaded;
}

LoadedConfig parse_config(std::string_view toml_text, std::string_view place,
                          std::span<const std::string> sets) {
  Loader loader;
  loader.add_file(toml_text, place);
  for (const std::string& set : sets) loader.add_set(set);
  return loader.finish();
}

std::string config_as_toml(const DaemonConfig& config) {
  DaemonConfig copy = config;
  std::string text;
  append_comment(text,
                 "Configuration of loopd, every parameter with its meaning. What is left out "
                 "has its default.");
  append_comment(text,
                 "loopd --config FILE --check tells all mistakes; --print-config writes this "
                 "file; man 5 loopd.toml.");
  std::string_view section;
  for (const Row& row : daemon_parameters()) {
    if (section_of(row.key) != section) {
      section = section_of(row.key);
      text.append("\n[").append(section).append("]\n");
    }
    const ParameterRef ref = row.ref(copy);
    text += '\n';
    append_comment(text, row.reason);
    append_comment(text, unit_and_range(row, ref));
    text.append(name_of(row.key)).append(" = ").append(toml_value(ref)).append("\n");
  }
  return text;
}

}  // namespace loopd
