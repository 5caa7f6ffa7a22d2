//! Only the address of the page leads to the page, with any head.

use proptest::prelude::*;

use super::request::{Answer, Gate};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

fn gate() -> Gate {
    Gate::new(8080, TOKEN.to_owned())
}

fn is_closed(head: &[u8]) -> bool {
    match gate().answer(head) {
        Answer::Refused(..) => true,
        Answer::File { name, .. } => name != "index.html",
        Answer::Socket { .. } => false,
    }
}

/// Parts of requests, right ones and wrong ones.
fn part() -> impl Strategy<Value = String> {
    prop_oneof![
        Just("GET /socket?token=".to_owned()),
        Just("GET /?token=".to_owned()),
        Just(TOKEN[1..].to_owned()),
        Just(" HTTP/1.1\r\n".to_owned()),
        Just("Host: 127.0.0.1:8080\r\n".to_owned()),
        Just("Origin: http://127.0.0.1:8080\r\n".to_owned()),
        Just("Connection: Upgrade\r\nUpgrade: websocket\r\n".to_owned()),
        Just("Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n".to_owned()),
        Just("\r\n".to_owned()),
        "\\PC{0,20}",
    ]
}

proptest! {
    #[test]
    fn without_the_token_no_head_of_any_parts_opens_the_page(parts in prop::collection::vec(part(), 0..16)) {
        prop_assert!(is_closed(parts.concat().as_bytes()));
    }

    #[test]
    fn any_bytes_get_an_answer(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(is_closed(&bytes));
    }
}

#[test]
fn the_key_of_an_answer_is_that_of_rfc_6455() {
    let head = format!(
        "GET /socket?token={TOKEN} HTTP/1.1\r\nHost: localhost:8080\r\nOrigin: http://localhost:8080\r\n\
         Connection: keep-alive, Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    );
    let accept = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=".to_owned();
    assert_eq!(gate().answer(head.as_bytes()), Answer::Socket { accept });
}
