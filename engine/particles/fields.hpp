// The one field table: every quantity that a grain carries. Storage, sorting, migration, halo, checkpoints, snapshots and
// Python arrays are derived from it. To add a field, add a row.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace moraine {

enum class Field : std::uint8_t {
  position,
  radius,
  velocity,
  inverse_mass,
  angular_velocity,
  inverse_inertia,
  gid,
  material,
  dissipated,
  force,
  torque,
  gas_acceleration,
  count_
};
inline constexpr std::size_t n_fields = static_cast<std::size_t>(Field::count_);

enum class FieldType : std::uint8_t { real, gid, index };  // double, std::uint64_t, std::uint16_t

/// When a field crosses from one owner to another.
enum class Travel : std::uint8_t {
  every_step,  // ghosts need it fresh in each step
  with_ghost,  // sent once, when a ghost is made
  with_owner,  // sent when a grain changes owner
  never        // computed where it is needed
};

/// Why a field is there; a scene that does not need it neither allocates, sends nor writes it.
enum class Need : std::uint8_t { always, rotation, energy, gas, requested };

struct FieldInfo {
  Field field;
  std::string_view name;
  FieldType type;
  int components;
  std::string_view unit;
  Travel travel;
  Need need;
  int record_slot;  // first double of the field in the hot record, or -1: an array of its own
};

/// The hot record: what a contact reads lies in one run of doubles,
/// x y z r | vx vy vz 1/m | wx wy wz 1/I (the last four only with rotation), so that four doubles are one load.
inline constexpr int record_size_plain = 8;
inline constexpr int record_size_rotating = 12;

inline constexpr std::array<FieldInfo, n_fields> field_table = {{
    {Field::position, "position", FieldType::real, 3, "m", Travel::every_step, Need::always, 0},
    {Field::radius, "radius", FieldType::real, 1, "m", Travel::with_ghost, Need::always, 3},
    {Field::velocity, "velocity", FieldType::real, 3, "m/s", Travel::every_step, Need::always, 4},
    {Field::inverse_mass, "inverse_mass", FieldType::real, 1, "1/kg", Travel::with_ghost, Need::always, 7},
    {Field::angular_velocity, "angular_velocity", FieldType::real, 3, "rad/s", Travel::every_step, Need::rotation, 8},
    {Field::inverse_inertia, "inverse_inertia", FieldType::real, 1, "1/(kg m2)", Travel::with_ghost, Need::rotation,
     11},
    {Field::gid, "gid", FieldType::gid, 1, "", Travel::with_ghost, Need::always, -1},
    {Field::material, "material", FieldType::index, 1, "", Travel::with_ghost, Need::always, -1},
    // lost so far to normal dashpots, tangential dashpots, friction, bulk viscosity and gas (less than nothing where it gives); counted at the grain of lower gid
    {Field::dissipated, "dissipated", FieldType::real, 4, "J", Travel::with_owner, Need::energy, -1},
    {Field::force, "force", FieldType::real, 3, "N", Travel::never, Need::requested, -1},
    {Field::torque, "torque", FieldType::real, 3, "N m", Travel::never, Need::requested, -1},
    // drag, pressure gradient and buoyancy over the mass, as the last gas step left them
    {Field::gas_acceleration, "gas_acceleration", FieldType::real, 3, "m/s2", Travel::with_owner, Need::gas, -1},
}};

constexpr const FieldInfo& info(Field field) { return field_table[static_cast<std::size_t>(field)]; }

constexpr std::size_t size_of(FieldType type) {
  return type == FieldType::real  ? sizeof(double)
         : type == FieldType::gid ? sizeof(std::uint64_t)
                                  : sizeof(std::uint16_t);
}

/// The field of that name, if there is one.
constexpr std::optional<Field> field_by_name(std::string_view name) {
  for (const FieldInfo& row : field_table)
    if (row.name == name) return row.field;
  return std::nullopt;
}

constexpr bool table_is_in_order() {
  for (std::size_t i = 0; i < n_fields; ++i)
    if (field_table[i].field != static_cast<Field>(i)) return false;
  return true;
}
static_assert(table_is_in_order(), "field_table must list the fields in the order of the enum");

}  // namespace moraine
