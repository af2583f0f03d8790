// SPDX-License-Identifier: MIT
/**
 * @file lanes.hpp
 * Numbers of eight lanes that stand where C code has scalars; of sixteen with LANES_SIXTEEN, which needs AVX-512.
 * There is `real_t` for float, `int_t` and `uint_t` for the 32-bit whole numbers, `ns_t` for 64-bit times, `wide_t` for
 * double. Lane i of a result is bit for bit what the scalar operation gives for lane i of the operands.
 *
 * A comparison gives a mask. As a condition it must be the same in all lanes; if not, the lanes part (divergence.h) and
 * lane 0 answers. `select` takes a mask as it is. A cast to a scalar must be the same in all lanes too. All types are
 * trivial: memset and memcpy work.
 */
#ifndef HIL_LANES_LANES_HPP
#define HIL_LANES_LANES_HPP

#include "divergence.h"
#include "vectors.hpp"

namespace lanes {
inline namespace OMNI_LANES_LEVEL {

#ifdef LANES_SIXTEEN
constexpr int count = 16; /* a vector of floats */
#else
constexpr int count = 8;
#endif

/** What comparisons of numbers as wide as Bits give. */
template <typename Bits>
class alignas(4 * count) alignas(vectors<Bits, count>) mask {
public:
    using vector = vectors<Bits, count>;
    static constexpr unsigned everywhere = (1u << count) - 1u;

    mask() = default;
    LANES_INLINE constexpr mask(bool value) : v(broadcast<Bits, count>(value ? -1 : 0)) {}
    LANES_INLINE constexpr explicit mask(vector bits) : v(bits) {}
    template <typename Other>
    LANES_INLINE explicit mask(mask<Other> other) : v(convert<Bits>(other.v)) {}

    /** The one answer of all lanes. */
    LANES_INLINE operator bool() const {
        const unsigned set = bits();
        if (__builtin_expect(set != 0 && set != everywhere, 0)) {
            hil_lanes_diverge();
            return (set & 1u) != 0;
        }
        return set != 0;
    }

    /** Bit i: lane i. */
    LANES_INLINE unsigned bits() const { return bit_mask(v); }
    LANES_INLINE bool any() const { return bits() != 0; }
    LANES_INLINE bool all() const { return bits() == everywhere; }

    LANES_INLINE friend mask operator!(mask a) {
        return mask(zip(a.v, a.v, [](auto x, auto) { return ~x; }));
    }
    LANES_INLINE friend mask operator&(mask a, mask b) {
        return mask(zip(a.v, b.v, [](auto x, auto y) { return x & y; }));
    }
    LANES_INLINE friend mask operator|(mask a, mask b) {
        return mask(zip(a.v, b.v, [](auto x, auto y) { return x | y; }));
    }
    /* Both sides are looked at, as they have no side effects. */
    LANES_INLINE friend mask operator&&(mask a, mask b) { return a & b; }
    LANES_INLINE friend mask operator||(mask a, mask b) { return a | b; }
    LANES_INLINE friend mask operator&&(bool a, mask b) { return mask(a) & b; }
    LANES_INLINE friend mask operator||(bool a, mask b) { return mask(a) | b; }
    LANES_INLINE friend mask operator&&(mask a, bool b) { return a & mask(b); }
    LANES_INLINE friend mask operator||(mask a, bool b) { return a | mask(b); }

    vector v;
};

template <typename T>
class alignas(4 * count) alignas(vectors<T, count>) number {
public:
    using scalar = T;
    using vector = vectors<T, count>;
    using mask_type = mask<bits_of<T>>;
    static constexpr bool whole = std::is_integral_v<T>;

    number() = default;
    /** The same in all lanes. A whole number takes whole numbers only: C's truncation wants a cast. */
    template <
        typename S,
        std::enable_if_t<std::is_enum_v<S> || std::is_integral_v<S> || (std::is_arithmetic_v<S> && !whole), int> = 0>
    LANES_INLINE constexpr number(S value) : v(broadcast<T, count>(static_cast<T>(value))) {}
    LANES_INLINE constexpr explicit number(vector value) : v(value) {}
    /** float to double is exact and needs no cast; every other conversion is C's cast. */
    template <typename S, std::enable_if_t<std::is_same_v<T, double> && std::is_same_v<S, float>, int> = 0>
    LANES_INLINE number(number<S> other) : v(convert<T>(other.v)) {}
    template <typename S, std::enable_if_t<!(std::is_same_v<T, double> && std::is_same_v<S, float>), int> = 0>
    LANES_INLINE explicit number(number<S> other) : v(cast(other)) {}

    LANES_INLINE static number load(const T *eight) { return number(lanes::load<T, count>(eight)); }
    LANES_INLINE void store(T *eight) const { std::memcpy(eight, &v, sizeof v); }
    LANES_INLINE T get(int lane) const {
        T value;
        std::memcpy(&value, reinterpret_cast<const char *>(&v) + sizeof(T) * static_cast<unsigned>(lane), sizeof value);
        return value;
    }
    LANES_INLINE void set(int lane, T value) {
        std::memcpy(reinterpret_cast<char *>(&v) + sizeof(T) * static_cast<unsigned>(lane), &value, sizeof value);
    }

    /** The one value of all lanes. */
    template <typename S, std::enable_if_t<std::is_arithmetic_v<S> && !std::is_same_v<S, bool>, int> = 0>
    LANES_INLINE explicit operator S() const {
        if (!same()) {
            hil_lanes_diverge();
        }
        return static_cast<S>(get(0));
    }
    /** Are all lanes the same, as bits? */
    LANES_INLINE bool same() const {
        using Bits = bits_of<T>;
        const mask<Bits> equal(compare(as_bits<Bits>(v), as_bits<Bits>(broadcast<T, count>(get(0))),
                                       [](auto x, auto y) { return x == y; }));
        return equal.all();
    }

    LANES_INLINE friend number operator-(number a) {
        return number(zip(a.v, a.v, [](auto x, auto) { return -x; }));
    }
    LANES_INLINE friend number operator+(number a) { return a; }
    // NOLINTBEGIN(bugprone-macro-parentheses): an operator cannot be put in parentheses
#define LANES_OPERATION(sign)                                                                                          \
    LANES_INLINE friend number operator sign(number a, number b) {                                                     \
        return number(zip(a.v, b.v, [](auto x, auto y) { return x sign y; }));                                         \
    }                                                                                                                  \
    LANES_INLINE number &operator sign##=(number b) {                                                                  \
        return *this = *this sign b;                                                                                   \
    }
#define LANES_COMPARISON(sign)                                                                                         \
    LANES_INLINE friend mask_type operator sign(number a, number b) {                                                  \
        return mask_type(compare(a.v, b.v, [](auto x, auto y) { return x sign y; }));                                  \
    }
    // NOLINTEND(bugprone-macro-parentheses)
    LANES_OPERATION(+)
    LANES_OPERATION(-)
    LANES_OPERATION(*)
    LANES_OPERATION(/)
    LANES_OPERATION(%)
    LANES_OPERATION(&)
    LANES_OPERATION(|)
    LANES_OPERATION(^)
    LANES_OPERATION(<<)
    LANES_OPERATION(>>)
    LANES_COMPARISON(==)
    LANES_COMPARISON(!=)
    LANES_COMPARISON(<)
    LANES_COMPARISON(<=)
    LANES_COMPARISON(>)
    LANES_COMPARISON(>=)
#undef LANES_OPERATION
#undef LANES_COMPARISON
    LANES_INLINE number &operator++() {
        return *this += number(1);
    }

    vector v;

private:
    template <typename S>
    LANES_INLINE static vector cast(number<S> other) {
        if constexpr (whole && number<S>::whole && sizeof(S) == sizeof(T)) {
            return as_bits<T>(other.v);
        } else {
            return convert<T>(other.v);
        }
    }
};

using real_t = number<float>;
using int_t = number<std::int32_t>;
using uint_t = number<std::uint32_t>;
using ns_t = number<std::uint64_t>;
using wide_t = number<double>;
using mask_t = mask<std::int32_t>;
using wide_mask_t = mask<std::int64_t>;

/** What a conditional expression over A and B is: the lane type among them, or that of the scalars. */
template <typename A, typename B>
struct either {
    using type = number<std::common_type_t<A, B>>;
};
template <typename A, typename B>
struct either<number<A>, B> {
    using type = number<A>;
};
template <typename A, typename B>
struct either<A, number<B>> {
    using type = number<B>;
};
template <typename A>
struct either<number<A>, number<A>> {
    using type = number<A>;
};
template <typename A>
struct either<mask<A>, mask<A>> {
    using type = mask<A>;
};
template <typename A>
struct either<mask<A>, bool> {
    using type = mask<A>;
};
template <typename A>
struct either<bool, mask<A>> {
    using type = mask<A>;
};
template <>
struct either<bool, bool> {
    using type = mask_t;
};

/** Per lane `condition ? a : b`; both are evaluated. */
template <typename Bits, typename A, typename B>
LANES_INLINE auto select(mask<Bits> condition, A a, B b) {
    using result = typename either<A, B>::type;
    const result first(a);
    const result second(b);
    if constexpr (std::is_same_v<result, mask<std::int32_t>> || std::is_same_v<result, mask<std::int64_t>>) {
        return (result(condition) & first) | ((!result(condition)) & second);
    } else {
        using choice = typename result::mask_type;
        return result(choose(choice(condition).v, first.v, second.v));
    }
}
template <typename A, typename B>
LANES_INLINE auto select(bool condition, A a, B b) {
    using result = typename either<A, B>::type;
    return condition ? result(a) : result(b);
}

template <typename Bits>
LANES_INLINE bool all(mask<Bits> condition) {
    return condition.all();
}
template <typename Bits>
LANES_INLINE bool any(mask<Bits> condition) {
    return condition.any();
}

template <typename T>
LANES_INLINE number<T> sqrt(number<T> a) {
    return number<T>(square_root(a.v));
}

/** |a|: clears the sign, of a NaN too. */
template <typename T>
LANES_INLINE number<T> abs(number<T> a) {
    using Bits = bits_of<T>;
    constexpr Bits sign = sizeof(T) == 4 ? static_cast<Bits>(INT32_MIN) : static_cast<Bits>(INT64_MIN);
    const auto magnitude = zip(as_bits<Bits>(a.v), broadcast<Bits, count>(~sign), [](auto x, auto y) { return x & y; });
    return number<T>(as_bits<T>(magnitude));
}

} // namespace OMNI_LANES_LEVEL
} // namespace lanes

#endif
