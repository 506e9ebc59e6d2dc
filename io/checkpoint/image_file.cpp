#include "io/checkpoint/image_file.hpp"

#include <algorithm>
#include <bit>
#include <string>
#include <utility>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace {

// What is added to a history must be written and read here, or a restart loses it without a word.
static_assert(sizeof(PairHistory) == 7 * 8 && sizeof(WallHistory) == 9 * 8,
              "a history has changed: checkpoints must keep all of it");

std::array<double, 3> as_array(Vec3 v) { return {v.x, v.y, v.z}; }
Vec3 as_vector(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }

std::string field_path(const FieldInfo& row) { return "particles/" + std::string(row.name); }

/// Names of accumulators are free text; those of datasets must not contain a slash, nor be empty or a dot.
std::string encoded(const std::string& name) {
  std::string text;
  for (const char c : name) text += c == '/' ? "%2F" : c == '%' ? "%25" : c == '\n' ? "%0A" : std::string(1, c);
  if (text.empty()) return "%00";
  return text == "." ? "%2E" : text;
}

std::string decoded(const std::string& text) {
  if (text == "%00") return {};
  std::string name;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%' || i + 2 >= text.size()) {
      name += text[i];
      continue;
    }
    name += static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16));
    i += 2;
  }
  return name;
}

std::size_t n_values(const FieldArray& array, const FieldInfo& row) {
  return row.type == FieldType::real  ? array.reals.size()
         : row.type == FieldType::gid ? array.gids.size()
                                      : array.indices.size();
}

/// One component or vector of all histories, as an array of its own.
template <class Entry, class Get>
auto column(const std::vector<Entry>& entries, Get get) {
  std::vector<decltype(get(entries[0]))> values;
  values.reserve(entries.size());
  for (const Entry& entry : entries) values.push_back(get(entry));
  return values;
}

template <class Entry>
std::vector<double> vectors(const std::vector<Entry>& entries, double (Entry::*member)[3]) {
  std::vector<double> values;
  values.reserve(3 * entries.size());
  for (const Entry& entry : entries)
    for (const double value : entry.*member) values.push_back(value);
  return values;
}

/// What springs hold; scenes without an energy ledger have none, and no dataset.
template <class Entry>
void write_energy(Hdf5Writer& file, const std::string& name, const std::vector<Entry>& entries) {
  if (std::any_of(entries.begin(), entries.end(),
                  [](const Entry& entry) { return std::bit_cast<std::uint64_t>(entry.energy) != 0; }))
    file.dataset(name, column(entries, [](const Entry& entry) { return entry.energy; }), 1, "J");
}

void check_length(const Hdf5Reader& file, const std::string& name, std::size_t found, std::size_t expected) {
  if (found != expected)
    throw StorageError(file.path(), "dataset '" + name + "' has " + std::to_string(found) + " rows, expected " +
                                        std::to_string(expected));
}

template <class Entry>
void read_energy(const Hdf5Reader& file, const std::string& name, std::vector<Entry>& entries) {
  if (!file.exists(name)) return;
  const std::vector<double> energy = file.reals(name);
  check_length(file, name, energy.size(), entries.size());
  for (std::size_t i = 0; i < energy.size(); ++i) entries[i].energy = energy[i];
}

FieldArray read_field(const Hdf5Reader& file, const FieldInfo& row, std::uint64_t n_grains) {
  FieldArray array;
  array.field = row.field;
  const std::string name = field_path(row);
  switch (row.type) {
    case FieldType::real: array.reals = file.reals(name, row.components); break;
    case FieldType::gid: array.gids = file.gids(name); break;
    case FieldType::index: array.indices = file.indices(name); break;
  }
  check_length(file, name, n_values(array, row) / static_cast<std::size_t>(row.components), n_grains);
  return array;
}

}  // namespace

std::uint64_t header_size(const Image& image, std::size_t n_more) {
  std::size_t n_characters = 40 * (n_fields + 8 + n_more);
  for (const auto& [name, values] : image.accumulators) n_characters += 16 + 3 * name.size();
  return seal_size(n_fields + 8 + n_more + image.accumulators.size(), n_characters);
}

void write_grains(Hdf5Writer& file, const Image& image) {
  file.attribute("step", image.step);
  file.attribute("time", image.time);
  file.attribute("time_step", image.time_step);
  file.attribute("domain_low", as_array(image.domain.low));
  file.attribute("domain_high", as_array(image.domain.high));
  file.attribute("periodic", std::array<double, 3>{double(image.periodic[0]), double(image.periodic[1]),
                                                   double(image.periodic[2])});
  file.attribute("grains", image.n_grains);
  file.attribute("state_hash", image.hash.text());
  for (const FieldArray& array : image.fields) {
    const FieldInfo& row = info(array.field);
    const std::string name = field_path(row);
    if (n_values(array, row) != image.n_grains * static_cast<std::size_t>(row.components))
      throw std::logic_error("field " + std::string(row.name) + " of an image has another length than its grains");
    switch (row.type) {
      case FieldType::real: file.dataset(name, array.reals, row.components, std::string(row.unit)); break;
      case FieldType::gid: file.dataset(name, array.gids); break;
      case FieldType::index: file.dataset(name, array.indices); break;
    }
  }
}

void write_history(Hdf5Writer& file, const Image& image) {
  const auto& pairs = image.pairs;
  file.dataset("contacts/pairs/gid_low", column(pairs, [](const PairHistory& p) { return p.gid_low; }));
  file.dataset("contacts/pairs/gid_high", column(pairs, [](const PairHistory& p) { return p.gid_high; }));
  file.dataset("contacts/pairs/image", column(pairs, [](const PairHistory& p) { return p.image; }));
  file.dataset("contacts/pairs/displacement", vectors(pairs, &PairHistory::displacement), 3, "m");
  write_energy(file, "contacts/pairs/energy", pairs);
  const auto& walls = image.walls;
  file.dataset("contacts/walls/gid", column(walls, [](const WallHistory& w) { return w.gid; }));
  file.dataset("contacts/walls/surface", column(walls, [](const WallHistory& w) { return w.surface; }));
  file.dataset("contacts/walls/normal", vectors(walls, &WallHistory::normal), 3);
  file.dataset("contacts/walls/displacement", vectors(walls, &WallHistory::displacement), 3, "m");
  write_energy(file, "contacts/walls/energy", walls);
  for (const auto& [name, values] : image.accumulators) file.dataset("accumulators/" + encoded(name), values);
}

Image read_grains(const Hdf5Reader& file, std::vector<std::string>* unknown) {
  Image image;
  image.step = file.integer_attribute("step");
  image.time = file.real_attribute("time");
  image.time_step = file.real_attribute("time_step");
  image.domain = {as_vector(file.vector_attribute("domain_low")), as_vector(file.vector_attribute("domain_high"))};
  const std::array<double, 3> periodic = file.vector_attribute("periodic");
  for (std::size_t axis = 0; axis < 3; ++axis) image.periodic[axis] = periodic[axis] != 0.0;
  image.n_grains = file.integer_attribute("grains");
  try {
    image.hash = Hash128::from_text(file.text_attribute("state_hash"));
  } catch (const std::invalid_argument&) {
    throw StorageError(file.path(), "attribute 'state_hash' is not a hash of 32 hexadecimal digits");
  }
  for (const std::string& name : file.children("particles")) {
    if (field_by_name(name)) continue;
    if (unknown == nullptr)
      throw StorageError(file.path(), "holds the field '" + name + "', which this program does not know");
    unknown->push_back(name);
  }
  for (const FieldInfo& row : field_table)
    if (file.exists(field_path(row))) image.fields.push_back(read_field(file, row, image.n_grains));
  return image;
}

void read_history(const Hdf5Reader& file, Image& image) {
  const auto low = file.gids("contacts/pairs/gid_low"), high = file.gids("contacts/pairs/gid_high");
  const auto shift = file.gids("contacts/pairs/image");
  const auto displacement = file.reals("contacts/pairs/displacement", 3);
  check_length(file, "contacts/pairs/gid_high", high.size(), low.size());
  check_length(file, "contacts/pairs/image", shift.size(), low.size());
  check_length(file, "contacts/pairs/displacement", displacement.size() / 3, low.size());
  image.pairs.reserve(low.size());
  for (std::size_t i = 0; i < low.size(); ++i)
    image.pairs.push_back(
        {low[i], high[i], shift[i], {displacement[3 * i], displacement[3 * i + 1], displacement[3 * i + 2]}, 0.0});
  read_energy(file, "contacts/pairs/energy", image.pairs);

  const auto gid = file.gids("contacts/walls/gid"), surface = file.gids("contacts/walls/surface");
  const auto normal = file.reals("contacts/walls/normal", 3), slip = file.reals("contacts/walls/displacement", 3);
  check_length(file, "contacts/walls/surface", surface.size(), gid.size());
  check_length(file, "contacts/walls/normal", normal.size() / 3, gid.size());
  check_length(file, "contacts/walls/displacement", slip.size() / 3, gid.size());
  image.walls.reserve(gid.size());
  for (std::size_t i = 0; i < gid.size(); ++i)
    image.walls.push_back({gid[i],
                           surface[i],
                           {normal[3 * i], normal[3 * i + 1], normal[3 * i + 2]},
                           {slip[3 * i], slip[3 * i + 1], slip[3 * i + 2]},
                           0.0});
  read_energy(file, "contacts/walls/energy", image.walls);
  for (const std::string& name : file.children("accumulators"))
    image.accumulators[decoded(name)] = file.reals("accumulators/" + name);
}

}  // namespace moraine
