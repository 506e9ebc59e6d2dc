#include "comm/halo.hpp"

#include <chrono>
#include <climits>
#include <stdexcept>

#include "comm/mpi.hpp"
#include "comm/wait.hpp"

namespace moraine {

namespace {

constexpr int halo_tag = 2;

std::size_t in_doubles(std::size_t bytes) { return (bytes + sizeof(double) - 1) / sizeof(double); }

int message_size(std::size_t bytes) {
  if (bytes > INT_MAX) throw std::runtime_error("a halo message of more than 2 GB: use more ranks");
  return static_cast<int>(bytes);
}

}  // namespace

struct Halo::Requests {
  std::vector<Link> links;
  std::vector<std::vector<double>> outgoing, incoming;
  std::vector<MPI_Request> all;
  std::uint64_t n_sends = 0, bytes_a_step = 0;
  std::uint64_t n_messages = 0, n_bytes = 0;
  double waited = 0.0;

  ~Requests() { close(); }
  void close() {
    int is_over = 0;
    if (!all.empty()) MPI_Finalized(&is_over);
    if (!is_over)
      for (MPI_Request& request : all) MPI_Request_free(&request);
    all.clear();
  }
};

Halo::Halo() : requests_(std::make_unique<Requests>()) {}
Halo::~Halo() = default;
Halo::Halo(Halo&&) noexcept = default;
Halo& Halo::operator=(Halo&&) noexcept = default;

void Halo::open(const World& world, std::vector<Link> links) {
  Requests& r = *requests_;
  r.close();
  r.links = std::move(links);
  r.outgoing.resize(r.links.size());
  r.incoming.resize(r.links.size());
  r.n_sends = r.bytes_a_step = 0;
  for (std::size_t k = 0; k < r.links.size(); ++k) {
    const Link& link = r.links[k];
    r.outgoing[k].resize(in_doubles(link.send_bytes));
    r.incoming[k].resize(in_doubles(link.receive_bytes));
    if (link.receive_bytes > 0) {
      r.all.emplace_back();
      MPI_Recv_init(r.incoming[k].data(), message_size(link.receive_bytes), MPI_BYTE, link.rank, halo_tag,
                    communicator_of(world), &r.all.back());
    }
  }
  for (std::size_t k = 0; k < r.links.size(); ++k) {
    const Link& link = r.links[k];
    if (link.send_bytes == 0) continue;
    r.all.emplace_back();
    MPI_Send_init(r.outgoing[k].data(), message_size(link.send_bytes), MPI_BYTE, link.rank, halo_tag,
                  communicator_of(world), &r.all.back());
    ++r.n_sends;
    r.bytes_a_step += link.send_bytes;
  }
}

std::size_t Halo::size() const { return requests_->links.size(); }

std::span<std::byte> Halo::outgoing(std::size_t k) {
  return {reinterpret_cast<std::byte*>(requests_->outgoing[k].data()), requests_->links[k].send_bytes};
}

std::span<const std::byte> Halo::incoming(std::size_t k) const {
  return {reinterpret_cast<const std::byte*>(requests_->incoming[k].data()), requests_->links[k].receive_bytes};
}

void Halo::start() {
  Requests& r = *requests_;
  if (r.all.empty()) return;
  MPI_Startall(static_cast<int>(r.all.size()), r.all.data());
  r.n_messages += r.n_sends;
  r.n_bytes += r.bytes_a_step;
}

void Halo::finish() {
  Requests& r = *requests_;
  if (r.all.empty()) return;
  const auto since = std::chrono::steady_clock::now();
  wait_for_all(r.all);
  r.waited += std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
}

std::uint64_t Halo::n_messages() const { return requests_->n_messages; }
std::uint64_t Halo::n_bytes() const { return requests_->n_bytes; }
double Halo::waited() const { return requests_->waited; }

}  // namespace moraine
