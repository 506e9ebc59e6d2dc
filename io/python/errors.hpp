// Errors of Moraine as Python exceptions.
#pragma once

namespace moraine {

/// Exceptions of C++ arrive in Python as those of moraine/errors.py from here on.
void translate_errors();

}  // namespace moraine
