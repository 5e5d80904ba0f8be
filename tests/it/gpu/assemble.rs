//! The small language that puts shaders together, and where it says that a mistake is.

use spao_server::gpu::{Assembled, ShaderError, assemble, assemble_from};

type Sources = [(&'static str, &'static str)];

fn assembled(sources: &Sources) -> Result<Assembled, ShaderError> {
    assemble_from(sources, "pass", &[("COUNT", 2)], &[])
}

/// Asserts where an error is and what it says.
#[track_caller]
fn assert_error<T: std::fmt::Debug>(result: Result<T, ShaderError>, file: &str, line: u32, says: &str) {
    let error = result.expect_err("an error");
    assert_eq!((error.file.as_str(), error.line), (file, line), "{error}");
    assert!(error.message.contains(says), "`{error}` does not say `{says}`");
    assert!(error.to_string().starts_with(&format!("{file}.wgsl:{line}: ")), "{error}");
}

#[test]
fn a_fragment_is_put_in_once_however_often_it_is_imported() {
    let sources = [
        ("pass", "#import common/a\n#import common/b\n#import common/a\nlast"),
        ("common/a", "of a"),
        ("common/b", "#import common/a\nof b"),
    ];
    let assembled = assembled(&sources).expect("all sources are there");
    assert_eq!(assembled.wgsl, "of a\nof b\nlast\n");
    assert_eq!(assembled.origins, [("common/a", 1), ("common/b", 2), ("pass", 4)]);
}

#[test]
fn fragments_that_import_each_other_end() {
    let sources =
        [("pass", "#import common/a\nx"), ("common/a", "#import common/b\na"), ("common/b", "#import common/a\nb")];
    assert_eq!(assembled(&sources).expect("each is put in once").wgsl, "b\na\nx\n");
}

#[test]
fn a_repeated_block_counts_and_knows_the_number_before() {
    let sources = [("pass", "#repeat K 1..=COUNT\nx@K@ = y@K-1@ + @J@;\n\n#end\nend")];
    let assembled = assembled(&sources).expect("COUNT has a value");
    assert_eq!(assembled.wgsl, "x1 = y0 + @J@;\n\nx2 = y1 + @J@;\n\nend\n");
    assert_eq!(assembled.origins, [("pass", 2), ("pass", 3), ("pass", 2), ("pass", 3), ("pass", 5)]);
    let none = assemble_from(&[("pass", "#repeat K 1..=COUNT\nx\n#end")], "pass", &[("COUNT", 0)], &[]);
    assert_eq!(none.expect("an empty range is fine").wgsl, "");
}

#[test]
fn a_fragment_can_be_replaced_by_another() {
    let sources = [("pass", "#import common/a"), ("common/a", "of a"), ("common/b", "of b")];
    let replaced = assemble_from(&sources, "pass", &[], &[("common/a", "common/b")]).expect("both are there");
    assert_eq!((replaced.wgsl.as_str(), replaced.origins[0].0), ("of b\n", "common/b"));
}

#[test]
fn what_cannot_be_put_together_is_an_error_that_names_file_and_line() {
    assert_error(assembled(&[("pass", "\n#import common/a")]), "pass", 2, "no shader source `common/a`");
    let nested = [("pass", "#import common/a"), ("common/a", "\n\n#import common/gone")];
    assert_error(assembled(&nested), "common/a", 3, "no shader source `common/gone`");
    let unbalanced = [("pass", "#import common/a"), ("common/a", "a\n#repeat K 0..=3\nb")];
    assert_error(assembled(&unbalanced), "common/a", 2, "`#repeat` without `#end`");
    assert_error(assembled(&[("pass", "a\n#end")]), "pass", 2, "unknown directive `#end`");
    assert_error(assembled(&[("pass", "#inport common/a")]), "pass", 1, "unknown directive `#inport common/a`");
    assert_error(assembled(&[("pass", "#repeat K 0..=MANY\n#end")]), "pass", 1, "`MANY` has no value");
    for head in ["#repeat K", "#repeat K 0..3", "#repeat K0..=3"] {
        let text = [("pass", &*format!("\n\n{head}\n#end").leak())];
        assert_error(assembled(&text), "pass", 3, "expected `#repeat NAME first..=last`");
    }
    assert_error(assemble("no_such_pass", &[], &[]), "no_such_pass", 0, "no shader source `no_such_pass`");
}

#[test]
fn a_syntax_error_is_where_it_was_written() {
    let parse = |sources: &Sources| assembled(sources).expect("the blocks are balanced").parse();
    let main = "@compute @workgroup_size(1)\nfn main() {}";
    parse(&[("pass", main)]).expect("this is WGSL");
    assert_error(parse(&[("pass", "fn f() {}\n\nfn g( {}")]), "pass", 3, "expected");
    let imported =
        [("pass", "fn f() {}\n#import common/a\nfn g() {}"), ("common/a", "\nfn a() {}\nfn b() { let x = ; }")];
    assert_error(parse(&imported), "common/a", 3, "expected");
    let after_import = [("pass", "#import common/a\nlet;"), ("common/a", "fn a() {}\nfn b() {}")];
    assert_error(parse(&after_import), "pass", 2, "expected");
    // The second of the repeated lines, not the fifth of the text.
    let repeated = [("pass", "#repeat K 1..=COUNT\nfn f@K@() {}\nfn g@K@() { let x = (1 + ; }\n#end")];
    assert_error(parse(&repeated), "pass", 3, "expected");
    let after_repeat = [("pass", "#repeat K 1..=COUNT\nfn f@K@() {}\n#end\n\nfn g() { oops }")];
    assert_error(parse(&after_repeat), "pass", 5, "");
}

#[test]
fn an_unknown_name_is_where_it_was_used() {
    let sources =
        [("pass", "#import common/a\nfn g() -> f32 { return missing; }"), ("common/a", "fn a() {}\nfn b() {}\n")];
    assert_error(assembled(&sources).expect("both are there").parse(), "pass", 2, "missing");
}

#[test]
#[should_panic(expected = "assertion `left == right` failed")]
fn the_error_helper_notices_another_line() {
    assert_error(assembled(&[("pass", "\n#inport common/a")]), "pass", 1, "unknown directive");
}

#[test]
#[should_panic(expected = "does not say")]
fn the_error_helper_notices_another_message() {
    assert_error(assembled(&[("pass", "#inport common/a")]), "pass", 1, "no shader source");
}
