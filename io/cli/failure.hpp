// How a job of several ranks ends when one of them cannot go on.
#pragma once

#include <functional>

#include "comm/world.hpp"

namespace moraine {

/// Ends the whole job with this exit code, after `say` has been called on one of the ranks that come here: the first of
/// its node, where lower ranks go before higher ones. The other ranks need not come: they wait for this one somewhere
/// and are ended.
[[noreturn]] void end_job(const World& world, int code, const std::function<void()>& say);

}  // namespace moraine
