#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/daemon_config.h"

namespace loopd {

/// A config and everything that is wrong with it. Only if `mistakes` is empty may `config` be used.
struct LoadedConfig {
  DaemonConfig config;
  /// One sentence each, beginning with its place ("front.toml:12: ", "--set: "), in the order of
  /// the file and then of the command line.
  std::vector<std::string> mistakes;

  bool ok() const { return mistakes.empty(); }
};

/// Reads the TOML file `path` (none: the defaults), then applies each "key=value" of `sets`, then
/// validates. Looks for every mistake and reports them all: syntax (only the first, with line and
/// column), unknown keys with the nearest name, wrong types, values out of range. In `sets`, text
/// needs no quotes and a list no brackets. The file may have up to 1 MiB. Reentrant.
LoadedConfig load_config(const std::optional<std::string>& path, std::span<const std::string> sets);

/// The same from the text of a file; `place` names it in mistakes.
LoadedConfig parse_config(std::string_view toml_text, std::string_view place,
                          std::span<const std::string> sets);

/// `config` as a TOML file in which every parameter is explained. Read back, it gives `config`;
/// that of a default config is config/loopd.toml.
std::string config_as_toml(const DaemonConfig& config);

}  // namespace loopd
