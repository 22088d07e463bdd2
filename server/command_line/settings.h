// The settings of varimeshd as options, group by group, with their ranges, defaults and help.
#pragma once

#include "server/command_line/flags.h"

namespace CLI {
class App;
}  // namespace CLI

namespace varimesh::server {

/// Flags whose units differ from those of the field that they set.
struct Units {
  double checkpoint_seconds = 5;
  int mesh_lifetime_hours = 7 * 24;
  int compress_minutes = 10;
  int ended_minutes = 60;
  int most_ended_hours = 0;
  double lease_seconds = 30;
  double watchdog_seconds = 45;
  double webhook_seconds = 5;
};

void add_connection_flags(CLI::App& app, Flags& flags);
void add_webhook_flags(CLI::App& app, WebhookSettings& webhooks, Units& units);
void add_resource_flags(CLI::App& app, Flags& flags);
void add_queue_flags(CLI::App& app, Limits& limits);
void add_state_flags(CLI::App& app, ServerOptions& options, Units& units);
void add_database_flags(CLI::App& app, Flags& flags, Units& units);

}  // namespace varimesh::server
