// SPDX-License-Identifier: MIT
/**
 * @file vectors.hpp
 * N numbers in vectors of the width the processor has: one vector, or two halves. Compilers keep a vector wider than
 * the registers in memory; halves they keep in registers. Everything here is the element-by-element IEEE operation and
 * nothing else, so each element is what the scalar code gives. Compiled once per CPU level (OMNI_LANES_LEVEL), each
 * level in a namespace of its own.
 */
#ifndef HIL_LANES_VECTORS_HPP
#define HIL_LANES_VECTORS_HPP

#include <cstdint>
#include <cstring>
#include <type_traits>

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON) && defined(__aarch64__)
#include <arm_neon.h>
#endif

#ifndef OMNI_LANES_LEVEL
#define OMNI_LANES_LEVEL baseline
#endif
#if defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512BW__) && defined(__AVX512VL__)
#define LANES_AVX512
#endif
#define LANES_INLINE inline __attribute__((always_inline))

namespace lanes {
inline namespace OMNI_LANES_LEVEL {

#if defined(LANES_AVX512)
constexpr int native_bytes = 64;
#elif defined(__AVX2__)
constexpr int native_bytes = 32;
#else
constexpr int native_bytes = 16;
#endif

/** Whole number as wide as T: what a comparison gives, all bits set or none. */
template <typename T>
using bits_of = std::conditional_t<sizeof(T) == 4, std::int32_t, std::int64_t>;

template <typename T, int N>
constexpr bool fits = N *static_cast<int>(sizeof(T)) <= native_bytes;

template <typename T, int N, bool single = fits<T, N>>
struct vectors;

template <typename T, int N>
struct vectors<T, N, true> {
    typedef T native __attribute__((vector_size(N * sizeof(T))));
    native v;
};

template <typename T, int N>
struct vectors<T, N, false> {
    vectors<T, N / 2> low;
    vectors<T, N / 2> high;
};

template <typename T, int N>
LANES_INLINE constexpr vectors<T, N> broadcast(T value) {
    if constexpr (fits<T, N>) {
        using native = typename vectors<T, N>::native;
        if constexpr (N == 16) {
            return {native{value, value, value, value, value, value, value, value, //
                           value, value, value, value, value, value, value, value}};
        } else if constexpr (N == 8) {
            return {native{value, value, value, value, value, value, value, value}};
        } else if constexpr (N == 4) {
            return {native{value, value, value, value}};
        } else {
            static_assert(N == 2);
            return {native{value, value}};
        }
    } else {
        return {broadcast<T, N / 2>(value), broadcast<T, N / 2>(value)};
    }
}

template <typename T, int N>
LANES_INLINE vectors<T, N> load(const T *from) {
    vectors<T, N> to;
    std::memcpy(&to, from, sizeof to);
    return to;
}

/** operation(vector, vector): a vector. */
template <typename Operation, typename T, int N>
LANES_INLINE vectors<T, N> zip(vectors<T, N> a, vectors<T, N> b, Operation operation) {
    if constexpr (fits<T, N>) {
        return {operation(a.v, b.v)};
    } else {
        return {zip(a.low, b.low, operation), zip(a.high, b.high, operation)};
    }
}

/** comparison(vector, vector): a vector of bits. */
template <typename Comparison, typename T, int N>
LANES_INLINE vectors<bits_of<T>, N> compare(vectors<T, N> a, vectors<T, N> b, Comparison comparison) {
    if constexpr (fits<T, N>) {
        using bits = typename vectors<bits_of<T>, N>::native;
        return {reinterpret_cast<bits>(comparison(a.v, b.v))};
    } else {
        return {compare(a.low, b.low, comparison), compare(a.high, b.high, comparison)};
    }
}

/** Per element: a where `choice` is set, else b. */
template <typename T, int N>
LANES_INLINE vectors<T, N> choose(vectors<bits_of<T>, N> choice, vectors<T, N> a, vectors<T, N> b) {
    if constexpr (fits<T, N>) {
        return {choice.v ? a.v : b.v};
    } else {
        return {choose(choice.low, a.low, b.low), choose(choice.high, a.high, b.high)};
    }
}

/** The same bits under another type of the same width. */
template <typename To, typename T, int N>
LANES_INLINE vectors<To, N> as_bits(vectors<T, N> a) {
    static_assert(sizeof(To) == sizeof(T));
    if constexpr (fits<T, N>) {
        return {reinterpret_cast<typename vectors<To, N>::native>(a.v)};
    } else {
        return {as_bits<To>(a.low), as_bits<To>(a.high)};
    }
}

/** Two halves, split out of one vector if need be. */
template <typename T, int N>
LANES_INLINE vectors<T, N, false> halves(vectors<T, N> a) {
    if constexpr (fits<T, N>) {
        vectors<T, N, false> split;
        std::memcpy(&split, &a, sizeof split);
        return split;
    } else {
        return a;
    }
}

template <typename T, int N>
LANES_INLINE vectors<T, N> join(vectors<T, N / 2> low, vectors<T, N / 2> high) {
    const vectors<T, N, false> split = {low, high};
    if constexpr (fits<T, N>) {
        vectors<T, N> joined;
        std::memcpy(&joined, &split, sizeof joined);
        return joined;
    } else {
        return split;
    }
}

/** C's conversion, element by element: to a whole number by truncation. */
template <typename To, typename T, int N>
LANES_INLINE vectors<To, N> convert(vectors<T, N> a) {
    if constexpr (fits<T, N> && fits<To, N>) {
        return {__builtin_convertvector(a.v, typename vectors<To, N>::native)};
    } else {
        const auto split = halves<T, N>(a);
        return join<To, N>(convert<To>(split.low), convert<To>(split.high));
    }
}

/** IEEE square root; NaN for negative ones. */
template <typename T, int N>
LANES_INLINE vectors<T, N> square_root(vectors<T, N> a) {
    if constexpr (!fits<T, N>) {
        return {square_root(a.low), square_root(a.high)};
    } else {
        using native = typename vectors<T, N>::native;
#if defined(__SSE2__)
        if constexpr (std::is_same_v<T, float> && sizeof(native) == 16) {
            return {reinterpret_cast<native>(_mm_sqrt_ps(reinterpret_cast<__m128>(a.v)))};
        } else if constexpr (sizeof(native) == 16) {
            return {reinterpret_cast<native>(_mm_sqrt_pd(reinterpret_cast<__m128d>(a.v)))};
        }
#endif
#if defined(LANES_AVX512)
        if constexpr (std::is_same_v<T, float> && sizeof(native) == 64) {
            return {reinterpret_cast<native>(_mm512_sqrt_ps(reinterpret_cast<__m512>(a.v)))};
        } else if constexpr (sizeof(native) == 64) {
            return {reinterpret_cast<native>(_mm512_sqrt_pd(reinterpret_cast<__m512d>(a.v)))};
        }
#endif
#if defined(__AVX2__)
        if constexpr (std::is_same_v<T, float> && sizeof(native) == 32) {
            return {reinterpret_cast<native>(_mm256_sqrt_ps(reinterpret_cast<__m256>(a.v)))};
        } else if constexpr (sizeof(native) == 32) {
            return {reinterpret_cast<native>(_mm256_sqrt_pd(reinterpret_cast<__m256d>(a.v)))};
        }
#elif !defined(__SSE2__) && defined(__ARM_NEON) && defined(__aarch64__)
        if constexpr (std::is_same_v<T, float>) {
            return {reinterpret_cast<native>(vsqrtq_f32(reinterpret_cast<float32x4_t>(a.v)))};
        } else {
            return {reinterpret_cast<native>(vsqrtq_f64(reinterpret_cast<float64x2_t>(a.v)))};
        }
#elif !defined(__SSE2__)
        for (int i = 0; i < N; ++i) {
            a.v[i] = std::is_same_v<T, float> ? static_cast<T>(__builtin_sqrtf(static_cast<float>(a.v[i])))
                                              : static_cast<T>(__builtin_sqrt(static_cast<double>(a.v[i])));
        }
        return a;
#endif
    }
}

/** A bit per element of a comparison's result. */
template <typename T, int N>
LANES_INLINE unsigned bit_mask(vectors<T, N> choice) {
    if constexpr (!fits<T, N>) {
        return bit_mask(choice.low) | bit_mask(choice.high) << (N / 2);
    } else {
#if defined(LANES_AVX512)
        if constexpr (sizeof choice == 64 && sizeof(T) == 4) {
            return _mm512_movepi32_mask(reinterpret_cast<__m512i>(choice.v));
        } else if constexpr (sizeof choice == 64) {
            return _mm512_movepi64_mask(reinterpret_cast<__m512i>(choice.v));
        }
#endif
#if defined(__AVX2__)
        if constexpr (sizeof choice == 32 && sizeof(T) == 4) {
            return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(choice.v)));
        } else if constexpr (sizeof choice == 32) {
            return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(choice.v)));
        }
#endif
#if defined(__SSE2__)
        if constexpr (sizeof choice == 16 && sizeof(T) == 4) {
            return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(choice.v)));
        } else if constexpr (sizeof choice == 16) {
            return static_cast<unsigned>(_mm_movemask_pd(reinterpret_cast<__m128d>(choice.v)));
        }
#else
        unsigned mask = 0;
        for (int i = 0; i < N; ++i) {
            mask |= static_cast<unsigned>(choice.v[i] & 1) << i;
        }
        return mask;
#endif
    }
}

} // namespace OMNI_LANES_LEVEL
} // namespace lanes

#endif
