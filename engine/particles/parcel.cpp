#include "engine/particles/parcel.hpp"

namespace moraine {

namespace {

bool travels(const FieldInfo& row, bool as_ghost) {
  return row.travel != Travel::never && (!as_ghost || row.travel != Travel::with_owner);
}

}  // namespace

void put_grain(const Particles& particles, std::int32_t i, bool as_ghost, ParcelWriter& parcel) {
  for (const FieldInfo& row : field_table) {
    if (!particles.has(row.field) || !travels(row, as_ghost)) continue;
    switch (row.type) {
      case FieldType::gid: parcel.put(particles.gid(i)); break;
      case FieldType::index: parcel.put(particles.material(i)); break;
      case FieldType::real:
        for (int c = 0; c < row.components; ++c) parcel.put(particles.real(row.field, i, c));
    }
  }
}

void get_grain(ParcelReader& parcel, bool as_ghost, Particles& particles, std::int32_t i) {
  for (const FieldInfo& row : field_table) {
    if (!particles.has(row.field) || !travels(row, as_ghost)) continue;
    switch (row.type) {
      case FieldType::gid: particles.set_gid(i, parcel.get<std::uint64_t>()); break;
      case FieldType::index: particles.set_material(i, parcel.get<std::uint16_t>()); break;
      case FieldType::real:
        for (int c = 0; c < row.components; ++c) particles.set_real(row.field, i, c, parcel.get<double>());
    }
  }
}

}  // namespace moraine
